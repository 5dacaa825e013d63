// What each enhancer gains over its tracker alone, with the interval that sequences of this number allow.

function gains(view) {
  const { scores, metric } = view;
  const rows = (scores.gains[metric.key] || [])
    .map((gain) => ({ gain, run: view.visible.find((run) => run.number === gain.run) }))
    .filter(({ run }) => run);
  const title = `Gains in ${metric.title.toLowerCase()}`;
  if (!rows.length) {
    return section("gains", title,
      note("No gain to show: that takes a tracker with an enhancer, and the same tracker without."));
  }
  const known = rows.flatMap(({ gain }) => [gain.gain_low, gain.gain_high, gain.gain, 0]).filter(isKnown);
  const scale = linear(Math.min(...known), Math.max(...known), 6, 234);
  const columns = [
    { key: "key", title: "", cell: ({ run }) => sample(run) },
    { key: "tracker", title: "Tracker", value: ({ run }) => run.tracker, cell: ({ run }) => named(run.tracker) },
    { key: "enhancer", title: "Enhancer", value: ({ run }) => run.enhancer, cell: ({ run }) => named(run.enhancer) },
    { key: "base", title: "alone", number: true, hint: "Score of the tracker alone on the same sequences",
      value: ({ gain }) => gain.base_value, cell: ({ gain }) => shown(gain.base_value) },
    { key: "difference", title: "difference", number: true, value: ({ gain }) => gain.difference,
      cell: ({ gain }) => signed(gain.difference, 3) },
    { key: "gain", title: "gain %", number: true, value: ({ gain }) => gain.gain,
      class: ({ gain }) => gainClass(gain), cell: ({ gain }) => gainText(gain) },
    { key: "interval", title: "95 % interval", cell: ({ gain, run }) => interval(gain, run, scale) },
    { key: "limits", title: "from, to %", number: true, value: ({ gain }) => gain.gain_low,
      cell: ({ gain }) => (isKnown(gain.gain_low) ? `${signed(gain.gain_low)}, ${signed(gain.gain_high)}` : MISSING) },
    { key: "improved", title: "better in", number: true, hint: "Share of the sequences that get better",
      value: ({ gain }) => gain.improved,
      cell: ({ gain }) => `${Math.round(gain.improved * gain.sequences)} of ${gain.sequences}` },
  ];
  const table = sortableTable(view, {
    name: "gains", columns, rows,
    caption: `${view.dataset.name}: ${subsetTitle(view.subset)}. Protocol ${view.protocol.title}.`,
    attributes: ({ run }) => ({ "data-run": run.number, focus: `gains-${run.number}`, on: lighting(run.number) }),
    act: ({ run }) => pin(view, run),
  });
  return section("gains", title, table, note(
    "Percent of the tracker alone. Paired bootstrap over sequences; a filled dot marks a gain or loss that the "
    + "sequences support, an open one what could be chance."));
}

function interval(gain, run, scale) {
  const text = isKnown(gain.gain_low) ? `${signed(gain.gain_low)} to ${signed(gain.gain_high)} percent` : "no interval";
  const node = drawn("svg", { class: `interval c${run.color}`, viewBox: "0 0 240 18", role: "img",
    "aria-label": `${text}${gain.certain ? "" : ", uncertain"}` });
  node.append(drawn("line", { class: "zero", x1: scale(0), x2: scale(0), y1: 0, y2: 18 }));
  if (isKnown(gain.gain_low)) {
    node.append(drawn("line", { class: "span", x1: scale(gain.gain_low), x2: scale(gain.gain_high), y1: 9, y2: 9 }));
  }
  if (isKnown(gain.gain)) {
    node.append(drawn("circle", { class: gain.certain ? "dot" : "dot open", cx: scale(gain.gain), cy: 9, r: 4 }));
  }
  return node;
}
