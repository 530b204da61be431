"use strict";
// Filters the list of cases; without it the page shows all of them.
(() => {
  const form = document.querySelector("form.filter");
  if (!form) return;
  form.hidden = false;
  const update = () => {
    const text = form.elements.text.value.trim().toLowerCase();
    const failed = form.elements.failed.checked;
    for (const group of document.querySelectorAll("details.group")) {
      const name = group.querySelector("summary code").textContent.toLowerCase();
      let shown = 0;
      for (const item of group.querySelectorAll("li.case")) {
        const fits = (name + " " + item.textContent.toLowerCase()).includes(text);
        item.hidden = !fits || (failed && item.hasAttribute("data-passed"));
        if (!item.hidden) shown += 1;
      }
      group.hidden = shown === 0;
      if (text || failed) group.open = shown > 0;
    }
  };
  form.addEventListener("input", update);
  form.addEventListener("submit", (event) => event.preventDefault());
})();
