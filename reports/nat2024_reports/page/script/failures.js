// Where targets were lost, and whether gains grow with uneven light.

function failures(view) {
  const table = view.dataset.failures;
  const title = "Losses";
  if (!table) {
    return section("failures", title, note("Losses were not analysed for these results."));
  }
  const nameOf = (row) => view.dataset.sequences[row.sequence].name;
  const shownRuns = new Map(view.visible.map((run) => [run.number, run]));
  const inSubset = new Set(view.subset.sequences);
  const wanted = view.state.find.trim().toLowerCase();
  const rows = table.rows.filter((row) => shownRuns.has(row.run) && inSubset.has(row.sequence)
    && matches(view.dataset.sequences[row.sequence], wanted));
  const columns = [
    { key: "run", title: "Run", class: () => "together", value: (row) => shownRuns.get(row.run).label,
      cell: (row) => [sample(shownRuns.get(row.run)), " ", named(shownRuns.get(row.run).label)] },
    { key: "sequence", title: "Sequence", value: (row) => nameOf(row), cell: (row) => named(nameOf(row)) },
    ...table.columns.map((column) => ({
      key: column.key, title: column.title, hint: column.hint, number: column.decimals !== null,
      value: (row) => row[column.key], cell: (row) => shown(row[column.key], column.decimals || 0),
    })),
  ];
  if (!rows.length) return section("failures", title, note("No loss among the runs and sequences shown."));
  return section("failures", `${title} (${rows.length})`, sortableTable(view, {
    name: "failures", columns, rows, tall: true,
    caption: `${view.dataset.name}: a row opens its sequence.`,
    attributes: (row) => ({
      "data-run": row.run, focus: `failure-${row.run}-${row.sequence}`, on: lighting(row.run),
    }),
    act: (row) => choose({ sequence: nameOf(row), frame: isKnown(row.first_loss) ? String(row.first_loss) : "" }),
  }));
}

function againstLight(view) {
  const title = "Gain against light";
  const choice = view.dataset.light.length > 1 && lightChooser(view);
  const scores = view.protocol.bySequence[view.metric.key] || [];
  const points = view.visible.filter((run) => run.base !== null && scores[run.number] && scores[run.base])
    .flatMap((run) => view.subset.sequences.map((number) => ({
      run, number, sequence: view.dataset.sequences[number], x: view.dataset.sequences[number].light[view.light.key],
      y: isKnown(scores[run.number][number]) && isKnown(scores[run.base][number])
        ? scores[run.number][number] - scores[run.base][number] : null,
    })))
    .filter((point) => isKnown(point.x) && isKnown(point.y));
  if (!points.length) {
    return section("light", title, note(scatterReason(view)));
  }
  const [low, high] = [Math.min(...points.map((p) => p.x)), Math.max(...points.map((p) => p.x))];
  const reach = Math.max(0.02, ...points.map((p) => Math.abs(p.y))) * 1.08;
  const pad = (high - low || 1) * 0.04;
  const drawing = chart({ width: 720, height: 360, left: 52, label: `${title}; one point a sequence and run`,
    x: { from: low - pad, to: high + pad, title: view.light.hint || view.light.title },
    y: { from: -reach, to: reach, title: `Difference in ${view.metric.title.toLowerCase()}`,
      format: (value) => (value ? signed(value, 2) : "0") } });
  const { node, xs, ys } = drawing;
  node.append(drawn("line", { class: "limit", x1: xs(low - pad), x2: xs(high + pad), y1: ys(0), y2: ys(0) }));
  const reading = drawn("text", { class: "reading", x: 712, y: 20, "text-anchor": "end" });
  for (const point of points) {
    const read = () => {
      reading.textContent = `${point.sequence.name}, ${point.run.label}: ${signed(point.y, 3)}`;
      light(point.run.number);
    };
    const leave = () => {
      reading.textContent = "";
      light(null);
    };
    const open = () => choose({ sequence: point.sequence.name, frame: "" });
    node.append(drawn("circle", {
      class: `point c${point.run.color}`, "data-run": point.run.number, cx: xs(point.x), cy: ys(point.y), r: 4.2,
      on: { pointerenter: read, pointerleave: leave, click: open },
    }));
  }
  node.append(reading);
  const correlation = points.length > 2 ? rankCorrelation(points) : NaN;
  return section("light", title, choice, element("figure", {}, node, element("figcaption", { class: "note" },
    "One point a sequence and enhanced run; above the line the enhancer helped. ",
    isKnown(correlation)
      && `Spearman\u2019s rank correlation over the ${points.length} points: ${signed(correlation, 2)}. `,
    "A point opens its sequence; the table of sequences has the same numbers.")));
}

function lightChooser(view) {
  return element("p", {}, element("label", { class: "soft" }, "Against ", element("select", {
    name: "light", "data-focus": "choose-light", on: { change: (event) => choose({ light: event.target.value }) },
  }, view.dataset.light.map((one) => element("option", { value: one.key, selected: one === view.light }, one.title)))));
}

function scatterReason(view) {
  if (!view.dataset.sequences.some((one) => isKnown(one.light[view.light.key]))) {
    return "The light in these sequences was not measured: there were no frames, or they were left out.";
  }
  return "No point to draw: that takes a tracker with an enhancer and the same tracker without, both shown, "
    + "on sequences with measured light.";
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
