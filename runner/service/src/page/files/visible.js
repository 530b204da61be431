// Which of many things are in sight: only these are brought up to date.

/** Tells each thing when it comes into sight; `part.isVisible` says whether it is. */
export function sight() {
  const parts = new WeakMap();
  const observer = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      const part = parts.get(entry.target);
      if (!part || part.isVisible === entry.isIntersecting) continue;
      part.isVisible = entry.isIntersecting;
      if (part.isVisible) part.appears();
    }
  }, { rootMargin: '200px' });
  return {
    add(part) {
      parts.set(part.node, part);
      observer.observe(part.node);
    },
    remove: (part) => observer.unobserve(part.node),
    end: () => observer.disconnect(),
  };
}
