// Small pictures of telling frames with the boxes of the runs shown, white for the ground truth.

function pictures(view, detail) {
  const numbers = new Set(view.visible.map((run) => run.number));
  const chosen = detail.pictures.filter((one) => one.run === null || numbers.has(one.run));
  if (!chosen.length) {
    return note(detail.pictures.length ? "No picture was chosen for the runs shown."
      : "No pictures: the frames were not there, or were left out.");
  }
  return element("div", { class: "gallery" }, chosen.map((one) => picture(view, one)));
}

function picture(view, one) {
  const [left, top, width, height] = one.window;
  const run = view.dataset.runs[one.run];
  const label = run ? labelOf(run) : "";
  const text = `Frame ${one.frame}${one.caption ? `: ${one.caption}` : ""}${label ? ` of ${label}` : ""}`;
  const boxes = view.visible.filter((shownRun) => one.boxes[shownRun.number]).map((shownRun) =>
    rectangle(one.boxes[shownRun.number], {
      class: `c${shownRun.color} d${shownRun.dash}`, "data-run": shownRun.number,
    }));
  const node = drawn("svg", {
    class: "picture", viewBox: `${left} ${top} ${width} ${height}`, role: "img", "aria-label": text,
  },
    drawn("image", { x: left, y: top, width, height, href: one.source, preserveAspectRatio: "none" }),
    boxes, one.truth && rectangle(one.truth, { class: "truth" }));
  return element("figure", {}, element("button", {
    type: "button", title: "Show this frame in the curves", "data-focus": `picture-${one.frame}`,
    on: { click: () => choose({ frame: String(one.frame) }) },
  }, node), element("figcaption", {}, text));
}

function rectangle([x, y, width, height], attributes) {
  return drawn("rect", { x, y, width: Math.max(0, width), height: Math.max(0, height), ...attributes });
}
