// Overlap, centre error and light over the frames of one sequence, under one common cursor.

const SIZE = { height: 210, left: 48, right: 10, top: 12, bottom: 32 };
const ERRORS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000];

function timelines(view, detail, sequence) {
  const frames = detail.frames || Array.from({ length: sequence.frames }, (_, i) => i);
  const tracks = view.visible.filter((run) => detail.tracks[run.number]).map((run) => ({
    run,
    losses: detail.tracks[run.number].losses,
    overlap: decodeBytes(detail.tracks[run.number].overlap, DATA.steps.overlap),
    error: decodeWords(detail.tracks[run.number].error, DATA.steps.error),
  }));
  const last = Math.max(1, sequence.frames - 1);
  const x = { from: 0, to: last, ticks: ticks(0, last, Math.min(10, wideChart() / 80)).filter(Number.isInteger) };
  const charts = [overlapChart(tracks, frames, x), errorChart(tracks, frames, x), ...lightCharts(detail.light, x)];
  const lowest = charts[charts.length - 1];
  lowest.node.append(drawn("text", { x: lowest.width / 2, y: lowest.height - 3, "text-anchor": "middle" }, "Frame"));
  const cursor = new Cursor(charts, frames, tracks);
  if (view.state.frame) cursor.go(Number(view.state.frame));
  return element("div", {
    class: "timeline", tabindex: "0", role: "group", "data-focus": "timeline",
    "aria-label": "Overlap and error over time; left and right arrow keys move the cursor",
    on: { keydown: (event) => cursor.press(event) },
  }, charts.map(({ title, node }) => element("figure", {}, element("h3", {}, title), node)), cursor.reading);
}

function drawSeries(drawing, tracks, frames, key) {
  for (const { run, [key]: values } of tracks) {
    drawing.node.append(drawn("path", { class: `curve c${run.color} d${run.dash}`, "data-run": run.number,
      d: pathOf(drawing.xs, drawing.ys, frames, values) }));
  }
}

function overlapChart(tracks, frames, x) {
  const drawing = chart({ ...SIZE, width: wideChart(), className: "series", label: "Overlap over time", x,
    y: { from: 0, to: 1, ticks: [0, 0.25, 0.5, 0.75, 1], title: "Overlap" } });
  drawSeries(drawing, tracks, frames, "overlap");
  tracks.forEach(({ run, losses }) => {
    if (!losses.length) return;
    const [a, b] = [drawing.xs(losses[0]), drawing.ys(0)];
    drawing.node.append(drawn("path", { class: `loss c${run.color}`, "data-run": run.number,
      d: `M${a} ${b}l-4.5 -8h9z` }, drawn("title", {}, `${run.label}: first loss at frame ${losses[0]}`)));
  });
  return { ...drawing, title: "Overlap; triangles mark the first loss" };
}

function errorChart(tracks, frames, x) {
  let highest = 50;
  for (const { error } of tracks) for (const value of error) if (value > highest) highest = value;
  const to = ERRORS.find((value) => value >= highest) || 10000;
  const drawing = chart({ ...SIZE, width: wideChart(), className: "series", label: "Centre location error over time", x,
    y: { log: true, from: 1, to, ticks: ERRORS.filter((value) => value <= to), title: "Centre error (px)" } });
  const { node, xs, ys, width, right } = drawing;
  drawSeries(drawing, tracks, frames, "error");
  node.append(drawn("line", { class: "limit above", x1: xs(x.from), x2: width - right, y1: ys(20), y2: ys(20) }),
    drawn("text", { class: "reading", x: width - right - 2, y: ys(20) - 5, "text-anchor": "end" }, "20 px"));
  return { ...drawing, title: "Centre location error, logarithmic; 20 px as in precision" };
}

function lightCharts(light, x) {
  return light.map((curve) => {
    const known = curve.values.filter(isKnown);
    const [low, high] = known.length ? [Math.min(...known), Math.max(...known)] : [0, 1];
    const pad = (high - low || Math.abs(high) || 1) * 0.08;
    const drawing = chart({ ...SIZE, width: wideChart(), height: 140, className: "series",
      label: `${curve.title} over time`, x,
      y: { from: low - pad, to: high + pad, ticks: ticks(low - pad, high + pad, 3), title: curve.unit } });
    const d = pathOf(drawing.xs, drawing.ys, curve.frames, curve.values);
    drawing.node.append(drawn("path", { class: "curve neutral", d }));
    return { ...drawing, title: curve.title };
  });
}

class Cursor {
  constructor(charts, frames, tracks) {
    Object.assign(this, { charts, frames, tracks, place: -1 });
    this.reading = element("p", { class: "note reading-line", "aria-live": "polite" },
      "Point at a curve, or use the arrow keys, to read a frame.");
    for (const one of charts) {
      one.line = drawn("line", { class: "cursor", visibility: "hidden", y1: one.top, y2: one.height - one.bottom, });
      one.node.append(one.line);
      one.node.addEventListener("pointermove", (event) => this.go(this.frameAt(one, event)));
      one.node.addEventListener("click", (event) =>
        choose({ frame: String(Math.round(this.frameAt(one, event))) }));
    }
  }

  frameAt({ node, xs }, event) {
    const share = (placeOf(node, event)[0] - xs.range[0]) / (xs.range[1] - xs.range[0]);
    return Math.max(xs.domain[0], Math.min(xs.domain[1], xs.domain[0] + share * (xs.domain[1] - xs.domain[0])));
  }

  go(frame) {
    const at = this.frames.findIndex((one) => one >= frame - 0.5);
    this.place = at < 0 ? this.frames.length - 1 : at;
    const x = this.charts[0].xs(this.frames[this.place]);
    for (const { line } of this.charts) {
      line.setAttribute("visibility", "visible");
      line.setAttribute("x1", x);
      line.setAttribute("x2", x);
    }
    const best = sorted(this.tracks, ({ overlap }) => overlap[this.place], true).slice(0, 6);
    const texts = best.map(({ run, overlap, error }) => [sample(run),
      ` ${run.label} ${shown(overlap[this.place], 2)}, ${shown(error[this.place], 1)} px; `]);
    this.reading.replaceChildren();
    filled(this.reading, {}, [`Frame ${this.frames[this.place]}: `, texts]);
  }

  press(event) {
    const steps = { ArrowLeft: -1, ArrowRight: 1, PageUp: -25, PageDown: 25, Home: -Infinity, End: Infinity };
    if (!(event.key in steps)) return;
    event.preventDefault();
    event.stopPropagation();
    const place = Math.max(0, Math.min(this.frames.length - 1, this.place + steps[event.key]));
    this.go(this.frames[place]);
  }
}
