// Whether gains grow with uneven light: one point a sequence and enhanced run.

// Colours tell trackers apart, shapes their enhancers, in the order of the lines of curves.
const SHAPES = [
  "M-4.2 0a4.2 4.2 0 1 0 8.4 0a4.2 4.2 0 1 0 -8.4 0z", "M-4 -4h8v8h-8z", "M-4 -4h8v8h-8z", "M0 -5l5 9h-10z",
  "M0 -5.4l5.4 5.4l-5.4 5.4l-5.4 -5.4z", "M0 5l5 -9h-10z",
];

function againstLight(view) {
  const title = "Gain against light";
  const points = lightPoints(view);
  if (!points.length) return section("light", title, note(scatterReason(view)));
  const drawing = scatterAxes(view, points);
  const reading = drawn("text", { class: "reading", x: drawing.width - 8, y: 20, "text-anchor": "end" });
  for (const point of points) drawing.node.append(pointOf(point, drawing, reading));
  drawing.node.append(reading);
  const caption = element("figcaption", { class: "note" },
    "One point a sequence and enhanced run; above the line the enhancer helped. ",
    correlationText(meansBySequence(points)),
    "A point opens its sequence; the table of sequences has the same numbers.");
  return section("light", title, view.dataset.light.length > 1 && lightChooser(view),
    element("figure", {}, drawing.node, markerLegend(points), caption));
}

function lightPoints(view) {
  const scores = view.protocol.bySequence[view.metric.key] || [];
  const runs = view.visible.filter((run) => run.base !== null && scores[run.number] && scores[run.base]);
  return runs.flatMap((run) => view.subset.sequences.map((number) => {
    const sequence = view.dataset.sequences[number];
    const [mine, base] = [scores[run.number][number], scores[run.base][number]];
    const y = isKnown(mine) && isKnown(base) ? mine - base : null;
    return { run, sequence, x: sequence.light[view.light.key], y };
  })).filter((point) => isKnown(point.x) && isKnown(point.y));
}

function scatterAxes(view, points) {
  const [low, high] = [Math.min(...points.map((p) => p.x)), Math.max(...points.map((p) => p.x))];
  const reach = Math.max(0.02, ...points.map((p) => Math.abs(p.y))) * 1.08;
  const pad = (high - low || 1) * 0.04;
  const drawing = chart({
    width: wideChart(), height: 400, left: 52, label: "Gain against light; the legend and the table have the names",
    x: { from: low - pad, to: high + pad, title: view.light.hint || view.light.title },
    y: { from: -reach, to: reach, title: `Difference in ${view.metric.title.toLowerCase()}`,
      format: (value) => (value ? signed(value, 2) : "0") },
  });
  const { node, xs, ys } = drawing;
  node.append(drawn("line", { class: "limit", x1: xs(low - pad), x2: xs(high + pad), y1: ys(0), y2: ys(0) }));
  return drawing;
}

function pointOf({ run, sequence, x, y }, { xs, ys }, reading) {
  const node = marker(run, xs(x), ys(y));
  node.addEventListener("pointerenter", () => {
    reading.textContent = `${sequence.name}, ${run.label}: ${signed(y, 3)}`;
    light(run.number);
  });
  node.addEventListener("pointerleave", () => {
    reading.textContent = "";
    light(null);
  });
  node.addEventListener("click", () => choose({ sequence: sequence.name, frame: "" }));
  return node;
}

function marker(run, x, y) {
  return drawn("path", { class: `point c${run.color}`, "data-run": run.number, d: SHAPES[run.dash],
    transform: `translate(${x.toFixed(1)} ${y.toFixed(1)})` });
}

function markerLegend(points) {
  const runs = [...new Set(points.map((point) => point.run))];
  const mark = (run) =>
    drawn("svg", { class: "mark", viewBox: "-6 -6 12 12", "aria-hidden": "true" }, marker(run, 0, 0));
  return element("ul", { class: "marks" }, runs.map((run) =>
    element("li", { "data-run": run.number, on: lighting(run.number) }, mark(run), named(run.label))));
}

function lightChooser(view) {
  const options = view.dataset.light.map((one) =>
    element("option", { value: one.key, selected: one === view.light }, one.title));
  return element("p", {}, element("label", { class: "soft" }, "Against ", element("select", {
    name: "light", "data-focus": "choose-light", on: { change: (event) => choose({ light: event.target.value }) },
  }, options)));
}

function scatterReason(view) {
  if (!view.dataset.sequences.some((one) => isKnown(one.light[view.light.key]))) {
    return "The light in these sequences was not measured: there were no frames, or they were left out.";
  }
  return "No point to draw: that takes a tracker with an enhancer and the same tracker without, both shown, "
    + "on sequences with measured light.";
}

// A sequence counts once, however many runs there are: their gains on it are no independent draws.
function meansBySequence(points) {
  const grouped = new Map();
  for (const point of points) grouped.set(point.sequence, [...(grouped.get(point.sequence) || []), point]);
  return [...grouped.values()].map((same) =>
    ({ x: same[0].x, y: same.reduce((sum, point) => sum + point.y, 0) / same.length }));
}

function correlationText(means) {
  const correlation = means.length > 2 ? rankCorrelation(means) : NaN;
  return isKnown(correlation) && `Spearman\u2019s rank correlation over ${means.length} sequences, `
    + `gains averaged over the runs shown: ${signed(correlation, 2)}${means.length < 6 ? " (too few to tell)" : ""}. `;
}

function rankCorrelation(points) {
  const ranksOfKey = (key) => {
    const values = points.map((point) => point[key]);
    const order = [...values].sort((a, b) => a - b);
    return values.map((value) => (order.indexOf(value) + order.lastIndexOf(value)) / 2);
  };
  const [a, b] = [ranksOfKey("x"), ranksOfKey("y")];
  const mean = (points.length - 1) / 2;
  const sum = (f) => points.reduce((total, _, i) => total + f(i), 0);
  const spread = Math.sqrt(sum((i) => (a[i] - mean) ** 2) * sum((i) => (b[i] - mean) ** 2));
  return spread ? sum((i) => (a[i] - mean) * (b[i] - mean)) / spread : NaN;
}
