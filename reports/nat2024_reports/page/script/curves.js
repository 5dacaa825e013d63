// Success, precision and normalized precision with ranked legends.

const PANELS = [
  { key: "success", title: "Success", score: "success_auc", x: "Overlap threshold", y: "Success rate" },
  { key: "precision", title: "Precision", score: "precision_20", x: "Centre location error threshold (px)",
    y: "Precision", mark: 20 },
  { key: "normalized_precision", title: "Normalized precision", score: "normalized_precision_20",
    x: "Normalized centre error threshold", y: "Normalized precision", mark: 0.2 },
];

function curves(view) {
  const panels = PANELS.filter((panel) => view.scores.curves[panel.key]).map((panel) => curvePanel(view, panel));
  const content = panels.length ? element("div", { class: "panels" }, panels)
    : note("No curve has a number under these choices.");
  return section("curves", curvesTitle(view), view.runs.length > 1 && panels.length > 0 && switches(view), content);
}

function curvesTitle(view) {
  return view.subset.kind === "all" ? "Curves: all sequences" : `Curves: ${subsetTitle(view.subset)}`;
}

// Everything on or off at once, so that a few of many runs are quickly alone.
function switches(view) {
  const names = view.runs.map((run) => run.name);
  const others = view.state.off.filter((name) => !names.includes(name));
  const press = (text, off, key) => element("button", {
    type: "button", "data-focus": key, on: { click: () => choose({ off }) },
  }, text);
  return element("p", { class: "switches" }, press("Show all", others, "show-all"),
    press("Hide all", [...others, ...names], "hide-all"));
}

function curvePanel(view, panel) {
  const { from, to, runs } = view.scores.curves[panel.key];
  const drawing = chart({ label: `${panel.title} curves; the list below has the numbers`, width: 380, height: 270,
    x: { from, to, title: panel.x }, y: { from: 0, to: 1, ticks: [0, 0.2, 0.4, 0.6, 0.8, 1], title: panel.y } });
  const { node, xs, ys } = drawing;
  if (panel.mark) {
    node.append(drawn("line", { class: "limit", x1: xs(panel.mark), x2: xs(panel.mark), y1: ys(0), y2: ys(1) }));
  }
  const reading = drawn("text", { class: "reading", x: xs(to) - 4, y: ys(1) + 12, "text-anchor": "end" });
  for (const run of [...view.visible].reverse()) {
    if (!runs[run.number]) continue;
    const values = decodeWords(runs[run.number], DATA.steps.share);
    const places = Array.from(values, (_, i) => from + (i * (to - from)) / (values.length - 1));
    const d = pathOf(xs, ys, places, values);
    node.append(drawn("path", { class: `curve c${run.color} d${run.dash}`, "data-run": run.number, d }),
      reachOf(view, run, drawing, values, reading, d));
  }
  node.append(reading);
  return element("figure", {}, element("h3", {}, panel.title), node, ranks(view, panel));
}

// A wide invisible line that is easy to hit; it reads the curve where the pointer is.
function reachOf(view, run, { node, xs }, values, reading, d) {
  const read = (event) => {
    const [x] = placeOf(node, event);
    const share = (x - xs.range[0]) / (xs.range[1] - xs.range[0]);
    const place = Math.max(0, Math.min(values.length - 1, Math.round(share * (values.length - 1))));
    const threshold = xs.domain[0] + (place * (xs.domain[1] - xs.domain[0])) / (values.length - 1);
    reading.textContent = `${run.label}: ${shown(values[place])} at ${Number(threshold.toFixed(2))}`;
  };
  return drawn("path", { class: "reach", d, on: {
    pointerenter: () => light(run.number),
    pointermove: read,
    pointerleave: () => { light(null); reading.textContent = ""; },
    click: () => pin(view, run),
  } });
}

function ranks(view, panel) {
  const score = (run) => (view.scores.rows[run.number] || {})[panel.score];
  const ordered = sorted(view.runs.filter((run) => view.scores.rows[run.number]), score, true);
  return element("ol", { class: "ranks" }, ordered.map((run) => element("li", {}, element("button", {
    type: "button", "aria-pressed": !view.state.off.includes(run.name), "data-run": run.number,
    "data-focus": `rank-${panel.key}-${run.number}`,
    on: { click: () => choose({ off: toggled(view.state.off, run.name) }), ...lighting(run.number) },
  }, sample(run), element("span", {}, `[${shown(score(run))}]`), named(run.label)))));
}
