// Small pictures of telling frames with the boxes of the runs shown, white for the ground truth.

function pictures(view, detail, cursor) {
  const numbers = new Set(view.visible.map((run) => run.number));
  const chosen = detail.pictures.filter((one) => one.run === null || numbers.has(one.run));
  if (!chosen.length) return element("p", { class: "note" }, detail.pictures.length ? "No picture was kept for the runs shown." : "No pictures: the frames were not there, or were left out.");
  return element("div", { class: "gallery" }, chosen.map((one) => picture(view, one, cursor)));
}

function picture(view, one, cursor) {
  const [left, top, width, height] = one.window;
  const run = view.dataset.runs[one.run];
  const label = run ? labelOf(run) : "";
  const text = `Frame ${one.frame + 1}${one.caption ? `: ${one.caption}` : ""}${label ? ` of ${label}` : ""}`;
  const node = drawn("svg", { class: "picture", viewBox: `${left} ${top} ${width} ${height}`, role: "img", "aria-label": text },
    drawn("image", { x: left, y: top, width, height, href: one.source, preserveAspectRatio: "none" }),
    one.truth && rectangle(one.truth, { class: "truth" }),
    view.visible.filter((shownRun) => one.boxes[shownRun.number]).map((shownRun) => rectangle(one.boxes[shownRun.number],
      { class: `c${shownRun.color} d${shownRun.dash}`, "data-run": shownRun.number })));
  return element("figure", {}, element("button", { type: "button", title: "Show this frame in the curves",
    on: { click: () => { cursor.go(one.frame); choose({ frame: String(one.frame + 1) }); } } }, node),
    element("figcaption", {}, text));
}

function rectangle([x, y, width, height], attributes) {
  return drawn("rect", { x, y, width: Math.max(0, width), height: Math.max(0, height), ...attributes });
}
