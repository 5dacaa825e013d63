// Axes, scales and lines that every chart shares. Everything is vector, so that print stays sharp.

function linear(from, to, start, end) {
  const scale = (value) => start + ((value - from) / (to - from || 1)) * (end - start);
  scale.domain = [from, to];
  scale.range = [start, end];
  return scale;
}

function logarithmic(from, to, start, end) {
  const inner = linear(Math.log(from), Math.log(to), start, end);
  return (value) => inner(Math.log(Math.max(from, Math.min(to, value))));
}

// Width of a chart across the page, so that its letters keep their size on a telephone.
function wideChart() {
  return Math.max(330, Math.min(1200, document.documentElement.clientWidth - 40));
}

// A frame of axes; gives the node to draw into and both scales.
function chart({ width = 400, height = 270, label, x, y, left = 42, right = 8, top = 8, bottom = 36, className = "" }) {
  const xs = (x.log ? logarithmic : linear)(x.from, x.to, left, width - right);
  const ys = (y.log ? logarithmic : linear)(y.from, y.to, height - bottom, top);
  const node = drawn("svg", {
    class: `chart ${className}`, viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": label,
  });
  for (const value of y.ticks || ticks(y.from, y.to, 5)) {
    node.append(
      drawn("line", { class: "grid", x1: left, x2: width - right, y1: ys(value), y2: ys(value) }),
      drawn("text", { x: left - 6, y: ys(value) + 3.5, "text-anchor": "end" }, y.format ? y.format(value) : value),
    );
  }
  const floor = height - bottom;
  for (const value of x.ticks || ticks(x.from, x.to, Math.min(8, width / 70))) {
    node.append(
      drawn("line", { class: "axis", x1: xs(value), x2: xs(value), y1: floor, y2: floor + 4 }),
      drawn("text", { x: xs(value), y: floor + 15, "text-anchor": "middle" }, x.format ? x.format(value) : value),
    );
  }
  node.append(drawn("path", { class: "axis", d: `M${left} ${floor}H${width - right}` }));
  const middle = (left + width - right) / 2;
  if (x.title) node.append(drawn("text", { x: middle, y: height - 4, "text-anchor": "middle" }, x.title));
  if (y.title) {
    const transform = `translate(10 ${(top + floor) / 2}) rotate(-90)`;
    node.append(drawn("text", { "text-anchor": "middle", transform }, y.title));
  }
  return { node, xs, ys, width, height, left, right, top, bottom };
}

// A path with gaps where a value is not known; single points get a short dash of their own.
function pathOf(xs, ys, places, values) {
  const parts = [];
  let isOpen = false;
  for (let i = 0; i < values.length; i += 1) {
    if (!isKnown(values[i])) {
      isOpen = false;
      continue;
    }
    const point = `${xs(places[i]).toFixed(1)} ${ys(values[i]).toFixed(1)}`;
    const isAlone = !isOpen && !isKnown(values[i + 1]);
    parts.push(isOpen ? `L${point}` : `M${point}${isAlone ? "h1" : ""}`);
    isOpen = true;
  }
  return parts.join("");
}

// Where a pointer is in the coordinates of the drawing.
function placeOf(node, event) {
  const box = node.getBoundingClientRect();
  const size = node.viewBox.baseVal;
  return [
    ((event.clientX - box.left) / box.width) * size.width,
    ((event.clientY - box.top) / box.height) * size.height,
  ];
}
