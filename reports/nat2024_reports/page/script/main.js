// Puts the parts together, anew for every change of the address.

const THEMES = { dark: "Light", light: "Dark" };
const scrolled = new Map();
let lastView = null;
let drawnWidth = 0;

function start() {
  DATA = JSON.parse(byId("data").textContent);
  byId("static").remove();
  history.scrollRestoration = "manual";
  window.addEventListener("hashchange", render);
  window.addEventListener("scroll", () => scrolled.set(lastView, window.scrollY), { passive: true });
  window.addEventListener("resize", resized);
  document.querySelector(".skip").addEventListener("click", (event) => {
    event.preventDefault();
    byId("main").focus();
  });
  document.addEventListener("keydown", leaveSequence);
  startTheme();
  render();
}

function render() {
  const active = document.activeElement || document.body;
  const { focus } = active.dataset;
  const caret = active.selectionStart;
  const inner = [...document.querySelectorAll("[data-table]")].map((table) =>
    [table.dataset.table, table.parentNode.scrollTop, table.parentNode.scrollLeft]);
  const view = select(readState());
  const name = view.sequence < 0 ? "" : view.dataset.sequences[view.sequence].name;
  byId("summary").textContent = summaryOf(view);
  byId("controls").replaceChildren(controls(view));
  byId("view").replaceChildren(...(view.sequence < 0 ? overviewParts(view) : sequenceView(view)));
  drawnWidth = wideChart();
  pinnedRun = view.pinned;
  light(null);
  document.title = name ? `${name} \u2013 ${DATA.title}` : DATA.title;
  for (const [table, top, left] of inner) {
    const found = document.querySelector(`[data-table="${table}"]`);
    if (found) found.parentNode.scrollTo(left, top);
  }
  restore(focus, caret, lastView !== null && lastView !== name, name);
  lastView = name;
  document.body.dataset.shown = location.hash;
}

function overviewParts(view) {
  const { remarks } = view.dataset;
  const unknown = view.state.sequence
    && element("p", { class: "remarks" }, `There is no sequence ${view.state.sequence} in ${view.dataset.name}.`);
  const items = remarks.map((text) => element("li", {}, text));
  return [
    unknown,
    items.length > 0 && element("ul", { class: "remarks", "aria-label": "Remarks" }, items),
    overview(view), curves(view), gains(view), attributes(view), sequences(view), failures(view), againstLight(view),
  ].filter(Boolean);
}

function summaryOf(view) {
  const { dataset } = view;
  const frames = dataset.sequences.reduce((sum, one) => sum + one.frames, 0);
  const counts = [counted(dataset.sequences.length, "sequence"), counted(frames, "frame"),
    counted(dataset.runs.length, "run")];
  return `${dataset.name}: ${counts.join(", ")}. One-pass evaluation.`;
}

// A new view starts at its top, or where it was left; otherwise the focus stays where it was.
function restore(focus, caret, isOther, name) {
  const node = focus === undefined ? null : focusable(focus);
  if (isOther) {
    window.scrollTo(0, scrolled.get(name) && !name ? scrolled.get(name) : 0);
    const target = name ? byId("title-sequence") : focusable(`sequence-${lastView}`);
    if (target) target.focus({ preventScroll: true });
  } else if (node) {
    node.focus({ preventScroll: true });
    if (node.type === "search") node.setSelectionRange(caret, caret);
  }
}

// Charts across the page are drawn for its width; a telephone that is turned gets them anew.
function resized() {
  if (wideChart() !== drawnWidth && !window.matchMedia("print").matches) render();
}

function focusable(key) {
  return document.querySelector(`[data-focus="${CSS.escape(key)}"]`);
}

function leaveSequence(event) {
  if (event.key !== "Escape" || !readState().sequence) return;
  choose({ sequence: "", frame: "" });
}

function startTheme() {
  const button = byId("theme");
  const system = window.matchMedia("(prefers-color-scheme: dark)");
  const now = () => document.documentElement.dataset.theme || (system.matches ? "dark" : "light");
  const label = () => {
    button.textContent = THEMES[now()];
    button.setAttribute("aria-label", `${THEMES[now()]} colours`);
  };
  try {
    const kept = localStorage.getItem("nat-bench-theme");
    if (kept in THEMES) document.documentElement.dataset.theme = kept;
  } catch { /* a browser may keep nothing for files */ }
  button.addEventListener("click", () => {
    document.documentElement.dataset.theme = now() === "dark" ? "light" : "dark";
    try {
      localStorage.setItem("nat-bench-theme", document.documentElement.dataset.theme);
    } catch { /* as above */ }
    label();
  });
  system.addEventListener("change", label);
  button.hidden = false;
  label();
}
