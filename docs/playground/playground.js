// The playground's page: shows what the engine in the worker says of a run.
"use strict";

(() => {
  const DATA = JSON.parse(document.getElementById("data").textContent);
  /** How long the engine may think before it is stopped, in ms. */
  const PATIENCE = 30000;
  /** Moments drawn before and behind the chosen one. */
  const AROUND = 60;
  /** The longest module that is read: the ABI's limit is far below. */
  const FILE_BYTES = 4 << 20;
  const $ = (id) => document.getElementById(id);

  // ---- The engine, in a worker: whatever it does, the page stays alive.

  function worker() {
    let exports;
    const answer = (request, module) => {
      const line = new TextEncoder().encode(request + "\n");
      const length = line.length + (module ? module.length : 0);
      const at = exports.playground_buffer(length);
      new Uint8Array(exports.memory.buffer).set(line, at);
      if (module) new Uint8Array(exports.memory.buffer).set(module, at + line.length);
      const answered = exports.playground_answer();
      const from = exports.playground_address();
      return new TextDecoder().decode(new Uint8Array(exports.memory.buffer, from, answered));
    };
    self.onmessage = async ({ data }) => {
      try {
        if (data.engine) {
          exports = (await WebAssembly.instantiate(data.engine, {})).instance.exports;
          return;
        }
        while (!exports) await new Promise((resume) => setTimeout(resume, 5));
        self.postMessage({ id: data.id, answer: answer(data.request, data.module) });
      } catch (error) {
        self.postMessage({ id: data.id, broken: String(error) });
      }
    };
  }

  const bytesOf = (base64) => Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
  const engine = {
    worker: null, next: 1, waiting: new Map(), module: null,
    start() {
      const source = URL.createObjectURL(new Blob([`(${worker})()`], { type: "text/javascript" }));
      this.worker = new Worker(source);
      URL.revokeObjectURL(source);
      this.worker.onmessage = ({ data }) => {
        const waiting = this.waiting.get(data.id);
        this.waiting.delete(data.id);
        if (!waiting) return;
        clearTimeout(waiting.timer);
        if (data.broken) {
          // A module that ended in the middle of something is not used further.
          this.restart();
          waiting.fail(new Error(`the engine failed: ${data.broken}`));
        } else {
          waiting.take(JSON.parse(data.answer));
        }
      };
      this.worker.postMessage({ engine: bytesOf(DATA.engine) });
    },
    restart() {
      this.worker.terminate();
      for (const { timer, fail } of this.waiting.values()) {
        clearTimeout(timer);
        fail(new Error("the engine was stopped"));
      }
      this.waiting.clear();
      this.start();
      if (this.module) this.post({ do: "load" }, this.module);
    },
    post(request, module) {
      const id = this.next++;
      this.worker.postMessage({ id, request: JSON.stringify(request), module });
      return id;
    },
    ask(request, module) {
      return new Promise((take, fail) => {
        const id = this.post(request, module);
        // To begin takes as long as it takes: nothing of anybody else's runs there yet.
        const timer = request.do === "begin" ? 0 : setTimeout(() => {
          this.waiting.delete(id);
          this.restart();
          fail(new Error(`stopped after ${PATIENCE / 1000} s: this run has too much in it`));
        }, PATIENCE);
        this.waiting.set(id, { take, fail, timer });
      });
    },
  };

  // ---- What is shown.

  let cases = [], names = [], about = null, run = null, at = 0, now = 0, playing = null, ran = 0;

  /** An element with texts, never with markup, inside. */
  function make(tag, attributes = {}, ...inside) {
    const svg = ["svg", "g", "line", "path", "rect", "text", "polygon", "title"].includes(tag);
    const made = svg ? document.createElementNS("http://www.w3.org/2000/svg", tag) : document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    made.append(...inside.filter((part) => part !== null));
    return made;
  }

  const seconds = (us) => `${us < 0 ? "-" : ""}${Math.floor(Math.abs(us) / 1e6)}.${String(Math.abs(us) % 1e6).padStart(6, "0")}`;
  const hex = (byte) => byte.toString(16).toUpperCase().padStart(2, "0");
  /** The reading of bytes: text in quotes, controls by their names. */
  function reading(bytes) {
    let text = "", plain = "";
    const close = () => { if (plain) text += `${text && " "}'${plain}'`; plain = ""; };
    for (const byte of bytes) {
      const name = names[byte];
      if (/^'.'$/u.test(name)) { plain += name[1]; continue; }
      close();
      text += `${text && " "}${name}`;
    }
    close();
    return text;
  }
  const cut = (text, most) => (text.length > most ? `${text.slice(0, most - 1)}…` : text);
  const brief = (bytes, most) => cut(bytes.length > 3 ? reading(bytes) : `${bytes.map(hex).join(" ")}  ${reading(bytes)}`, most);

  // ---- The plug-in.

  async function load(module, name) {
    stop();
    const shown = doubt();
    let answer;
    try {
      answer = await engine.ask({ do: "load" }, module);
    } catch (error) {
      answer = { refused: { text: error.message } };
    }
    const area = $("about");
    if (answer.refused) {
      area.className = "bad";
      area.textContent = `${name}: ${answer.refused.text}`;
      $("verdict").className = shown;
      return false;
    }
    engine.module = module;
    about = answer.loaded;
    area.className = "";
    area.replaceChildren(
      make("b", {}, `${about.name} ${about.version}`),
      ` ${about.protocol}; ${about.bytes.toLocaleString("en")} bytes, memory ${about.pages * 64} KiB, SHA-256 ${about.sha256.slice(0, 16)}… `,
      about.description);
    return true;
  }

  async function choosePlugin(name) {
    if (await load(bytesOf(DATA.plugins[name]), name)) showProfiles(about.profiles[0]);
  }

  async function takeFile(file) {
    if (!file) return;
    const other = [...$("plugin").options].find((option) => option.value === "");
    other.textContent = file.name;
    $("plugin").value = "";
    if (file.size > FILE_BYTES) {
      $("about").className = "bad";
      $("about").textContent = `${file.name} has ${file.size.toLocaleString("en")} bytes: no plug-in is so large`;
      return;
    }
    const module = new Uint8Array(await file.arrayBuffer());
    if (!(await load(module, file.name))) return;
    const claimed = about.profiles.find((profile) => cases.some((known) => known.profile === profile));
    if (claimed && claimed !== $("profile").value) showProfiles(claimed);
    else start();
  }

  // ---- The trace.

  function showProfiles(chosen) {
    const profiles = [...new Set(cases.map((known) => known.profile))];
    const claimed = about ? about.profiles : [];
    $("profile").replaceChildren(...profiles.map((profile) =>
      make("option", { value: profile }, claimed.includes(profile) ? profile : `${profile} (not claimed)`)));
    $("profile").value = profiles.includes(chosen) ? chosen : profiles[0];
    showCases();
  }

  function showCases() {
    const ofProfile = cases.filter((known) => known.profile === $("profile").value);
    $("case").replaceChildren(...ofProfile.map(({ id, title }) => make("option", { value: id, title }, id)));
    showTrace();
  }

  function showTrace() {
    const chosen = cases.find((known) => known.id === $("case").value);
    if (!chosen) return;
    $("case").title = chosen.title;
    $("trace").value = chosen.trace;
    $("trace").scrollTop = $("trace").scrollHeight;
    start();
  }

  function showNumbers(reached, wrong) {
    const count = $("trace").value.split("\n").length;
    const lines = [];
    for (let line = 1; line <= count; line++) {
      const tag = line === wrong ? "i" : line === reached ? "b" : null;
      lines.push(tag ? make(tag, {}, String(line)) : String(line), "\n");
    }
    $("numbers").replaceChildren(...lines);
    $("numbers").scrollTop = $("trace").scrollTop;
  }

  /** Puts a line where its time belongs, above the first one that is later. */
  function putIn() {
    const words = $("more").value.trim();
    const match = /^(<<|<|!|\?|>|=|\.)\s*(.*)$/u.exec(words);
    if (!match) {
      $("fault").textContent = "a line begins with <, <<, !, ?, >, = or . and goes on with what happens: < 13";
      return;
    }
    const timed = /^\d+\.\d+/u.test(match[2]);
    const line = `${match[1]} ${timed ? "" : `${seconds(Math.max(0, now))} `}${match[2]}`;
    const due = Number(/\d+\.\d+/u.exec(line)[0]);
    const lines = $("trace").value.split("\n");
    const body = lines.findIndex((text) => text.trim() === "---" || text.trim() === "") + 1;
    let place = lines.findIndex((text, number) => {
      const time = /^\s*(?:<<|[<>!?=.])\s+(\d+\.\d+)/u.exec(text);
      return number >= body && time && Number(time[1]) > due;
    });
    if (place < 0) place = lines.at(-1) === "" ? lines.length - 1 : lines.length;
    lines.splice(place, 0, line);
    $("trace").value = lines.join("\n");
    $("more").value = "";
    start(now);
  }

  // ---- The run.

  const rates = () => Object.fromEntries([["flip", "flip"], ["lose", "drop"], ["insert", "insert"], ["seed", "seed"]]
    .map(([id, name]) => [name, Math.min(Number($(id).max), Math.max(0, Math.trunc(Number($(id).value) || 0)))]));

  async function start(keepTime) {
    if (!about) return;
    stop();
    const number = ++ran;
    $("fault").textContent = "";
    doubt();
    let answer;
    try {
      answer = await engine.ask({
        do: "run", trace: $("trace").value, id: $("case").value || null,
        permutation: $("permutation").value, noise: rates(),
      });
    } catch (error) {
      answer = { refused: { text: error.message } };
    }
    // Another run was asked for meanwhile.
    if (number !== ran) return;
    const { refused } = answer;
    if (refused) {
      run = null;
      $("walk").hidden = true;
      $("verdict").className = "bad";
      $("verdict").replaceChildren(make("b", {}, "Not run"), " ");
      const place = refused.place ? `line ${refused.place[0]}, column ${refused.place[1]}: ` : "";
      $("fault").textContent = place + refused.text;
      $("verdict").append(place + refused.text);
      showNumbers(0, refused.place ? refused.place[0] : 0);
      return;
    }
    run = answer.ran.run;
    run.noisy = answer.ran.noisy;
    $("walk").hidden = false;
    $("noisy").textContent = run.noisy ? `${run.noisy.count} characters damaged` : "";
    $("keep").hidden = !run.noisy || run.noisy.count === 0;
    showVerdict();
    $("slider").max = Math.max(0, run.moments.length - 1);
    $("differs").disabled = run.differs_at === null;
    if (keepTime !== undefined) toTime(keepTime);
    else go(run.differs_at ?? 0);
  }

  /** What the verdict was of is being replaced. Answers how it was shown. */
  function doubt() {
    const shown = $("verdict").className;
    $("verdict").className = "old";
    return shown;
  }

  function showVerdict() {
    const area = $("verdict"), { failure } = run;
    area.className = failure ? "bad" : "good";
    if (!failure) {
      const fuel = run.moments.length ? run.moments.at(-1).after.fuel : 0;
      area.replaceChildren(make("b", {}, "Passed"), ` up to ${seconds(run.end_us)} s; ${fuel.toLocaleString("en")} units of fuel`);
      return;
    }
    const what = {
      diverged: "does not do what the trace demands",
      "depends-on-cuts": "does something else when the same bytes are cut differently",
      "depends-on-swap": "does something else when it is saved and restored",
      "depends-on-past": "does something else behind what was before on the link",
      "depends-on-clock": "does something else at a later time of its clock",
      "depends-on-rooms": "does something else where the host has other rooms",
    }[failure.class];
    const { divergence, fault } = failure;
    area.replaceChildren(make("b", {}, what ? `The plug-in ${what}` : "The run ended before its time"));
    if (fault) area.append(` at ${seconds(fault.at_us)} s: ${fault.message}`);
    if (!divergence) return;
    area.append(` at ${seconds(divergence.at_us)} s${divergence.line ? `, line ${divergence.line}` : ""}`);
    const { expected, observed } = divergence;
    const place = expected.bytes.findIndex((byte, number) => byte !== observed.bytes[number]);
    const differs = place < 0 ? Math.min(expected.bytes.length, observed.bytes.length) : place;
    const pairs = (bytes) => bytes.flatMap((byte, number) =>
      [number === differs ? make("mark", {}, hex(byte)) : hex(byte), " "]);
    const row = (name, side) => [
      make("tr", {}, make("td", {}, name), make("td", {}, side.text)),
      side.bytes.length ? make("tr", {}, make("td"), make("td", {}, ...pairs(side.bytes), ` ${reading(side.bytes)}`)) : null,
    ];
    area.append(make("table", {}, ...row("expected", expected).filter(Boolean), ...row("observed", observed).filter(Boolean)));
  }

  // ---- Walking.

  function go(number, time) {
    if (!run || !run.moments.length) return;
    at = Math.min(run.moments.length - 1, Math.max(0, number));
    now = time ?? run.moments[at].at_us;
    $("slider").value = at;
    $("slider").setAttribute("aria-valuetext", `${seconds(now)} s`);
    $("time").value = seconds(now);
    $("count").textContent = `step ${at + 1} of ${run.moments.length}${run.is_cut ? ", cut: there is more" : ""}`;
    $("first").disabled = $("back").disabled = at === 0;
    $("last").disabled = $("forward").disabled = at === run.moments.length - 1;
    // With noise the lines are those of another text.
    showNumbers(run.noisy ? 0 : run.moments[at].line, 0);
    draw();
    showMoment();
  }

  /** To the last moment that is not later than a time. */
  function toTime(time) {
    if (!run) return;
    let number = run.moments.findLastIndex((moment) => moment.at_us <= time);
    if (number < 0) number = 0;
    go(number, Math.min(Math.max(time, run.moments[0]?.at_us ?? 0), Math.max(run.end_us, run.moments.at(-1)?.at_us ?? 0)));
  }

  function play() {
    if (playing) return stop();
    if (!run) return;
    if (at === run.moments.length - 1) go(0);
    let before = performance.now();
    playing = setInterval(() => {
      const then = performance.now();
      const until = now + (then - before) * 1000 * Number($("speed").value);
      before = then;
      toTime(Math.round(until));
      if (at === run.moments.length - 1) stop();
    }, 40);
    $("play").textContent = "Stop";
    $("play").setAttribute("aria-pressed", "true");
  }

  function stop() {
    clearInterval(playing);
    playing = null;
    $("play").textContent = "Play";
    $("play").setAttribute("aria-pressed", "false");
  }

  // ---- The picture.

  function draw() {
    const width = Math.max(340, $("picture").clientWidth), narrow = width < 480, pitch = 22;
    const [partner, plugin, host] = narrow ? [82, width * 0.56, width - 24] : [110, width * 0.54, width - 60];
    const letters = (from, to) => Math.max(8, Math.floor((to - from) / 7.3) - 3);
    const first = Math.max(0, at - AROUND), end = Math.min(run.moments.length, at + AROUND + 1);
    const svg = make("svg", { role: "img", "aria-label": "Sequence diagram: partner, plug-in and host, time downwards" });
    const words = (x, y, text, kind) => make("text", { x, y, class: kind }, text);
    const arrow = (from, to, y) => {
      const back = to > from ? -7 : 7;
      return [make("line", { x1: from, x2: to, y1: y, y2: y, class: "arrow" }),
        make("polygon", { points: `${to},${y} ${to + back},${y - 4} ${to + back},${y + 4}`, class: "tip" })];
    };
    let y = 40, chosenAt = 0, before = null;
    const rows = [];
    for (let number = first; number < end; number++) {
      const moment = run.moments[number];
      const group = make("g", { class: `moment${number === at ? " chosen" : ""}${number > at ? " later" : ""}${number === run.differs_at ? " differs" : ""}` });
      const lines = labels(moment);
      const height = pitch * lines.length + 2;
      group.append(make("rect", { x: 1, y, width: width - 2, height, rx: 4 }));
      if (moment.at_us !== before) group.append(words(narrow ? 66 : 84, y + 15, seconds(moment.at_us), "time"));
      before = moment.at_us;
      lines.forEach(({ from, to, text, state }, index) => {
        const middle = y + pitch * index + 15;
        const lanes = { line: partner, plugin, host };
        if (to === undefined) {
          group.append(words(plugin, middle, cut(text, letters(partner, host)), `note${state ? " state" : ""}`));
          return;
        }
        const [a, b] = [lanes[from], lanes[to]];
        group.append(...arrow(a, b, middle + 4), words((a + b) / 2, middle - 1, cut(text, letters(Math.min(a, b), Math.max(a, b))), "label"));
      });
      if (moment.what.step?.fault) group.classList.add("bad");
      group.addEventListener("click", () => { stop(); go(number); });
      if (number === at) chosenAt = y + height / 2;
      rows.push(group);
      y += height;
    }
    const lives = [partner, plugin, host].map((x) => make("line", { x1: x, x2: x, y1: 30, y2: y + 8, class: "life" }));
    const heads = [[partner, "partner"], [plugin, "plug-in"], [host, "host"]].map(([x, name]) => words(x, 20, name, "head"));
    const more = [];
    if (first > 0) more.push(words(plugin, 36, `${first} before`, "note"));
    if (end < run.moments.length) more.push(words(plugin, y + 22, `${run.moments.length - end} more`, "note"));
    svg.append(...rows.map((row) => row.firstChild), ...lives, ...heads, ...more);
    // Rectangles lie below the lifelines, all else above.
    rows.forEach((row, index) => { const back = svg.children[index]; row.prepend(back.cloneNode()); back.setAttribute("fill", "none"); svg.append(row); });
    svg.setAttribute("viewBox", `0 0 ${width} ${y + 34}`);
    svg.setAttribute("height", y + 34);
    $("picture").replaceChildren(svg);
    $("picture").scrollTop = chosenAt - $("picture").clientHeight / 2;
  }

  /** What a moment is drawn as, one line each. */
  function labels({ what }) {
    if (what.wire) return [{ from: "plugin", to: "line", text: brief(what.wire, 60) }];
    if (what.break) return [{ from: "plugin", to: "line", text: `break of ${what.break} µs` }];
    const { given, actions, fault } = what.step;
    const text = (phrase) => (phrase.bytes ? `${phrase.text === "received" ? "" : `${phrase.text} `}${brief(phrase.bytes, 60)}` : phrase.text);
    const lines = [given.other === "link" ? { text: text(given) } : { from: given.other, to: "plugin", text: text(given) }];
    for (const action of actions) {
      if (action.other === "host") lines.push({ from: "plugin", to: "host", text: text(action) });
      // What is sent is drawn when it leaves.
      else if (action.other === "link") lines.push({ text: text(action), state: action.text.startsWith("state:") });
      else if (!action.bytes) lines.push({ text: text(action) });
    }
    if (fault) lines.push({ text: fault });
    return lines;
  }

  // ---- The chosen moment.

  function bytesList(bytes) {
    const shown = bytes.slice(0, 512).map((byte) =>
      make("span", { title: `${byte} = 0x${hex(byte)}` }, hex(byte), make("small", {}, names[byte].replace(/^'(.)'/u, "$1").replace(/^.*=/u, ""))));
    if (bytes.length > 512) shown.push(make("span", {}, `… ${bytes.length - 512} more`));
    return make("div", { class: "bytes" }, ...shown);
  }

  function showMoment() {
    const { at_us, what, after } = run.moments[at];
    const area = $("moment");
    area.replaceChildren();
    if (what.wire || what.break) {
      area.append(make("h2", {}, what.wire ? "Bytes leave on the line" : `A break of ${what.break} µs leaves`));
      if (what.wire) area.append(bytesList(what.wire));
    } else {
      const { step } = what;
      area.append(make("h2", {}, step.given.text));
      if (step.given.bytes) area.append(bytesList(step.given.bytes));
      area.append(make("h3", {}, step.actions.length ? "What the plug-in does" : "The plug-in does nothing"));
      area.append(make("ul", {}, ...step.actions.map((action) =>
        make("li", {}, action.text, action.bytes ? bytesList(action.bytes) : ""))));
      if (step.fault) area.append(make("p", { class: "words" }, step.fault));
      if (step.last_words && !step.fault.includes(step.last_words)) area.append(make("p", { class: "words" }, step.last_words));
      if (step.frames.length) area.append(make("p", { class: "words" }, `in ${step.frames.join("\nfrom ")}`));
    }
    const timers = after.timers.map(({ id, until_us }) => `timer ${id} at ${seconds(until_us)} s, in ${seconds(until_us - now)} s`);
    const facts = [
      ["time", `${seconds(at_us)} s`],
      ["state", after.state ?? "not told"],
      ["timers", timers.join("; ") || "none"],
      ["queue", after.is_held ? "held" : "free"],
      ["fuel", `${what.step ? `${what.step.fuel.toLocaleString("en")} for this, ` : ""}${after.fuel.toLocaleString("en")} in all`],
      ["instance", what.step ? String(what.step.instance) : "–"],
    ];
    $("standing").replaceChildren(make("dl", {}, ...facts.flatMap(([name, fact]) => [make("dt", {}, name), make("dd", {}, fact)])));
  }

  // ---- Hands on.

  function soon(work, wait) {
    let timer;
    return () => { clearTimeout(timer); timer = setTimeout(work, wait); };
  }

  function listen() {
    const edited = soon(() => start(), 400);
    $("trace").addEventListener("input", () => { showNumbers(0, 0); edited(); });
    $("trace").addEventListener("scroll", () => { $("numbers").scrollTop = $("trace").scrollTop; });
    $("trace").addEventListener("keydown", (event) => { if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) start(); });
    $("plugin").addEventListener("change", () => { if ($("plugin").value) choosePlugin($("plugin").value); });
    $("profile").addEventListener("change", showCases);
    $("case").addEventListener("change", showTrace);
    $("permutation").addEventListener("change", () => start());
    $("run").addEventListener("click", () => start());
    $("add").addEventListener("click", putIn);
    $("more").addEventListener("keydown", (event) => { if (event.key === "Enter") putIn(); });
    for (const id of ["flip", "lose", "insert", "seed"]) $(id).addEventListener("input", edited);
    $("again").addEventListener("click", () => { $("seed").value = Number($("seed").value) + 1; start(); });
    $("keep").addEventListener("click", () => {
      $("trace").value = run.noisy.trace;
      for (const id of ["flip", "lose", "insert"]) $(id).value = 0;
      start();
    });
    $("open").addEventListener("click", () => $("file").click());
    $("file").addEventListener("change", () => takeFile($("file").files[0]));
    for (const kind of ["dragover", "dragleave", "drop"]) {
      document.addEventListener(kind, (event) => {
        event.preventDefault();
        $("drop").classList.toggle("over", kind === "dragover");
        if (kind === "drop") takeFile(event.dataTransfer.files[0]);
      });
    }
    const walk = {
      first: () => go(0), back: () => go(at - 1), forward: () => go(at + 1),
      last: () => run && go(run.moments.length - 1), differs: () => run && run.differs_at !== null && go(run.differs_at),
    };
    for (const [id, step] of Object.entries(walk)) $(id).addEventListener("click", () => { stop(); step(); });
    $("play").addEventListener("click", play);
    $("slider").addEventListener("input", () => { stop(); go(Number($("slider").value)); });
    $("time").addEventListener("change", () => { stop(); toTime(Math.round(Number($("time").value.replace(",", ".")) * 1e6) || 0); });
    for (const button of document.querySelectorAll("[data-advance]")) {
      button.addEventListener("click", () => { stop(); toTime(now + Number(button.dataset.advance)); });
    }
    const keys = { ArrowLeft: "back", ArrowUp: "back", ArrowRight: "forward", ArrowDown: "forward", Home: "first", End: "last", d: "differs" };
    document.addEventListener("keydown", (event) => {
      const typing = event.target.closest("input, textarea, select, button, summary");
      if (typing || !run || event.ctrlKey || event.altKey || event.metaKey) return;
      if (event.key === " ") play();
      else if (keys[event.key]) { stop(); walk[keys[event.key]](); }
      else return;
      event.preventDefault();
    });
    addEventListener("resize", soon(() => { if (run) draw(); }, 100));
  }

  async function begin() {
    $("plugin").append(...Object.keys(DATA.plugins).map((name) => make("option", { value: name }, name)), make("option", { value: "" }, "a file of yours"));
    listen();
    engine.start();
    const { begun } = await engine.ask({ do: "begin" });
    cases = begun.cases;
    names = begun.names;
    await choosePlugin(Object.keys(DATA.plugins).at(-1));
    $("plugin").value = about.name;
  }

  begin().catch((error) => {
    $("verdict").className = "bad";
    $("verdict").textContent = `The playground cannot start here: ${error.message}`;
  });
})();
