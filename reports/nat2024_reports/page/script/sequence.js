// One sequence: what happened when, under which light, and what it looked like.

function sequenceView(view) {
  const sequence = view.dataset.sequences[view.sequence];
  const detail = detailOf(view);
  return [
    crumbs(view),
    element("section", { "aria-labelledby": "title-sequence" },
      element("h2", { id: "title-sequence", tabindex: "-1" }, sequence.name),
      facts(view, sequence), sequenceScores(view, detail)),
    element("section", { "aria-label": "Over time" }, timelines(view, detail, sequence)),
    section("pictures", "Telling frames", pictures(view, detail),
      detail.pictures.length > 0 && note("Ground truth is white; boxes have the colours and lines of the runs",
        view.visible.some((run) => run.color === INK) ? ", but black is light grey." : ".")),
  ];
}

function crumbs(view) {
  const all = view.subset.sequences;
  const place = all.indexOf(view.sequence);
  const neighbour = (step, text) => {
    const number = place < 0 ? undefined : all[place + step];
    if (number === undefined) return null;
    const { name } = view.dataset.sequences[number];
    return element("a", {
      href: linkTo({ sequence: name, frame: "" }), rel: step > 0 ? "next" : "prev", "data-focus": `crumb-${step}`,
    }, step < 0 ? `\u2190 ${name}` : `${name} \u2192`);
  };
  return element("nav", { class: "crumbs", "aria-label": "Sequences" },
    element("a", { href: linkTo({ sequence: "", frame: "" }), "data-focus": "crumb-all" }, "All sequences"),
    element("span", { class: "end" }, neighbour(-1), neighbour(1)));
}

function facts(view, sequence) {
  const fact = (title, value) => value !== "" && value !== null
    && element("div", {}, element("dt", {}, `${title} `), element("dd", {}, value));
  return element("dl", { class: "facts" },
    fact("Dataset", view.dataset.name),
    fact("Frames", sequence.frames.toLocaleString("en")),
    fact("Category", sequence.category),
    sequence.attributes.length > 0 && fact("Attributes", attributeList(sequence)),
    view.dataset.light.filter((one) => isKnown(sequence.light[one.key]))
      .map((one) => fact(one.title, shown(sequence.light[one.key], one.decimals))));
}

function sequenceScores(view, detail) {
  const value = (run, metric) => ((view.protocol.bySequence[metric] || [])[run] || [])[view.sequence];
  const rows = view.runs.filter((run) => detail.tracks[run.number] || isKnown(value(run.number, view.metric.key)))
    .map((run) => ({ run, losses: (detail.tracks[run.number] || { losses: [] }).losses }));
  if (!rows.length) return note("No run shown has a result of this sequence.");
  const metrics = view.metrics.filter((one) => rows.some(({ run }) => isKnown(value(run.number, one.key))));
  const columns = [
    ...runColumns(view),
    ...metrics.map((metric) => {
      const ranked = ranksOf(rows.map(({ run }) => value(run.number, metric.key)));
      return {
        key: metric.key, title: metric.title, hint: metric.hint, number: true,
        value: ({ run }) => value(run.number, metric.key),
        class: (row) => ({ 1: "best", 2: "second" })[ranked[rows.indexOf(row)]],
        cell: ({ run }) => shown(value(run.number, metric.key)),
      };
    }),
    ...(view.dataset.failures ? [{
      key: "loss", title: "first loss", number: true, hint: "Frame in which the first loss begins, from 0",
      value: ({ losses }) => (losses.length ? losses[0] : null),
      cell: ({ losses }) => (losses.length ? losses[0] : MISSING),
    }] : []),
  ];
  return sortableTable(view, {
    name: "one", columns, rows, caption: `Protocol ${view.protocol.title}.`,
    attributes: ({ run }, isSorted) => ({
      "data-run": run.number, focus: `one-${run.number}`, class: rowClass(view, rows, run, isSorted),
      "aria-current": run.number === view.pinned ? "true" : null, on: lighting(run.number),
    }),
    act: ({ run }) => pin(view, run),
  });
}
