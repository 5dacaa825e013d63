// Attributes, categories and sequences in rows, runs in columns: one score, or what it gains.

function attributes(view) {
  const subsets = view.dataset.subsets.map((subset, number) => ({ subset, scores: view.protocol.subsets[number] }))
    .filter(({ subset }) => subset.kind !== "all");
  if (!subsets.length) {
    return section("attributes", "Attributes and categories",
      note("Nothing tells attributes or categories of these sequences."));
  }
  const columns = [
    { key: "name", title: "Sequences with", isHead: true, value: ({ subset }) => `${subset.kind} ${subset.name}`,
      cell: ({ subset }) => [named(subset.name), dagger(subset.provenance)] },
    { key: "kind", title: "", cell: ({ subset }) => element("span", { class: "soft meaning" },
      subset.kind === "category" ? "category" : subset.meaning || "attribute") },
    { key: "count", title: "n", number: true, hint: "Number of sequences",
      value: ({ subset }) => subset.sequences.length, cell: ({ subset }) => subset.sequences.length },
    ...matrixRuns(view).map((run) => runColumn(view, run,
      ({ scores }) => (scores.rows[run.number] || {})[view.metric.key],
      ({ scores }) => gainOf(scores, view.metric.key, run.number))),
  ];
  const table = sortableTable(view, {
    name: "attributes", columns, rows: subsets, className: "matrix", caption: matrixCaption(view),
    attributes: ({ subset }) => ({
      focus: `attributes-${subsetKey(subset)}`, "aria-current": subset === view.subset ? "true" : null,
    }),
    act: ({ subset }) => choose({ subset: subset === view.subset ? "" : subsetKey(subset) }),
  });
  const hasComputed = subsets.some(({ subset }) => isComputed(subset.provenance));
  const few = subsets.some(({ subset }) => subset.sequences.length === 1);
  return section("attributes", "Attributes and categories", table, note(
    "A row chooses its sequences for the whole page. ",
    hasComputed && [dagger("computed"), ": computed from boxes and pixels, no published label. "],
    few && "With a single sequence a score is that sequence's, and no interval can be given. "));
}

function matrixCaption(view) {
  const score = view.metric.title;
  const what = view.gains ? `Gain in ${score.toLowerCase()} over the tracker alone, percent` : score;
  return `${what}. ${view.dataset.name}, protocol ${view.protocol.title}.`;
}

// Gains are of runs with an enhancer; the trackers alone have none.
function matrixRuns(view) {
  return view.gains ? view.visible.filter((run) => run.base !== null) : view.visible;
}

function dagger(provenance) {
  if (!isComputed(provenance)) return null;
  return element("span", { class: "dagger", title: `${provenance}, no published label` }, "\u2020");
}

function runColumn(view, run, value, gain) {
  const number = (row) => (view.gains ? (gain(row) || {}).gain : value(row));
  return {
    key: `run${run.number}`, title: run.label, number: true, run: run.number,
    head: { "data-run": run.number, on: lighting(run.number) },
    value: number,
    class: (row) => (view.gains ? gainClass(gain(row)) : heatClass(value(row))),
    cell: (row) => (view.gains ? gainText(gain(row)) || MISSING : shown(value(row))),
  };
}

function heatClass(value) {
  return isKnown(value) ? `heat h${Math.max(0, Math.min(9, Math.floor(value * 10)))}` : "";
}

function sequences(view) {
  const wanted = view.state.find.trim().toLowerCase();
  const inSubset = new Set(view.subset.sequences);
  const rows = view.dataset.sequences.map((sequence, number) => ({ sequence, number }))
    .filter(({ sequence, number }) => inSubset.has(number) && matches(sequence, wanted));
  const scores = view.protocol.bySequence[view.metric.key] || [];
  const value = (run, number) => (scores[run] || [])[number];
  const hasCategory = rows.some(({ sequence }) => sequence.category);
  const hasAttributes = rows.some(({ sequence }) => sequence.attributes.length);
  const light = rows.some(({ sequence }) => isKnown(sequence.light[view.light.key])) ? [view.light] : [];
  const columns = [
    { key: "name", title: "Sequence", isHead: true, value: ({ sequence }) => sequence.name,
      cell: ({ sequence }) => element("a", {
        href: linkTo({ sequence: sequence.name, frame: "" }), tabindex: "-1",
      }, named(sequence.name)) },
    { key: "frames", title: "frames", number: true, value: ({ sequence }) => sequence.frames,
      cell: ({ sequence }) => sequence.frames },
    ...(hasCategory ? [{ key: "category", title: "Category", value: ({ sequence }) => sequence.category || null,
      cell: ({ sequence }) => sequence.category || MISSING }] : []),
    ...(hasAttributes ? [{ key: "attributes", title: "Attributes",
      cell: ({ sequence }) => attributeList(sequence) }] : []),
    ...light.map((measure) => ({ key: "light", title: measure.title, number: true, hint: measure.hint,
      value: ({ sequence }) => sequence.light[measure.key],
      cell: ({ sequence }) => shown(sequence.light[measure.key], measure.decimals) })),
    ...matrixRuns(view).map((run) => runColumn(view, run, ({ number }) => value(run.number, number),
      ({ number }) => sequenceGain(run, value, number))),
  ];
  const all = view.dataset.sequences.length;
  const title = rows.length < all ? `Sequences (${rows.length} of ${all})` : `Sequences (${all})`;
  if (!rows.length) return section("sequences", title, note("No sequence fits these choices."));
  return section("sequences", title, sortableTable(view, {
    name: "sequences", columns, rows, className: "matrix", tall: true,
    caption: `${matrixCaption(view)} A row opens its sequence.`,
    attributes: ({ sequence }) => ({ focus: `sequence-${sequence.name}` }),
    act: ({ sequence }) => choose({ sequence: sequence.name, frame: "" }),
  }));
}

function matches(sequence, wanted) {
  if (!wanted) return true;
  const words = [sequence.name, sequence.category, ...sequence.attributes.map(([name]) => name)];
  return words.some((word) => word.toLowerCase().includes(wanted));
}

function attributeList(sequence) {
  return element("span", { class: "soft listing" }, sequence.attributes.map(([name, provenance], place) =>
    [place > 0 && ", ", name, dagger(provenance)]));
}

// A single sequence has a gain but no interval, so it is never marked as certain or uncertain.
function sequenceGain(run, value, number) {
  if (run.base === null) return null;
  const [mine, base] = [value(run.number, number), value(run.base, number)];
  if (!isKnown(mine) || !isKnown(base)) return null;
  return { gain: base ? (100 * (mine - base)) / base : null, difference: mine - base, certain: true };
}
