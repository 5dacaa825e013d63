// The table of a paper: trackers and enhancers with their scores and gains.

function overview(view) {
  const { runs, scores, metrics, subset } = view;
  const rows = runs.map((run) => ({ run, row: scores.rows[run.number] })).filter(({ row }) => row);
  const caption = overviewCaption(view, rows);
  if (!rows.length) {
    return section("scores", subsetTitle(subset), note("No run is left by these choices."));
  }
  const columns = [
    ...runColumns(view),
    ...metrics.flatMap((metric) => metricColumns(view, metric, rows)),
    ...speedColumn(rows),
  ];
  const table = sortableTable(view, {
    name: "scores", caption, columns, rows,
    attributes: ({ run }, isSorted) => ({
      "data-run": run.number, focus: `scores-${run.number}`,
      "aria-current": run.number === view.pinned ? "true" : null,
      class: rowClass(view, rows, run, isSorted), on: lighting(run.number),
    }),
    act: ({ run }) => pin(view, run),
  });
  return section("scores", subsetTitle(subset), table, legendOfMarks(view, rows));
}

function overviewCaption(view, rows) {
  const texts = rows.map(({ row }) => `${counted(row.sequences, "sequence")}, ${counted(row.frames, "frame")}`);
  const counts = [...new Set(texts)];
  return `${view.dataset.name}: ${counts.join(" / ")}. Protocol ${view.protocol.title} (${view.protocol.description}).`;
}

function rowClass(view, rows, run, isSorted) {
  const place = rows.findIndex((one) => one.run === run);
  const begins = !isSorted && place > 0 && rows[place - 1].run.tracker !== run.tracker;
  return [begins && "group", view.state.off.includes(run.name) && "off"].filter(Boolean).join(" ") || null;
}

function runColumns(view) {
  const scopes = new Set(view.runs.map((run) => run.scope).filter(Boolean));
  return [
    { key: "key", title: "", cell: ({ run }) => toggleButton(view, run) },
    { key: "tracker", title: "Tracker", value: ({ run }) => run.tracker,
      cell: ({ run }) => named(run.tracker) },
    { key: "enhancer", title: "Enhancer", value: ({ run }) => run.enhancer,
      cell: ({ run }) => named(run.enhancer === "none" ? MISSING : run.enhancer) },
    ...(scopes.size > 1 ? [{ key: "scope", title: "Scope",
      hint: "What was enhanced: the tracker's crops or the whole frame",
      value: ({ run }) => run.scope, cell: ({ run }) => (run.enhancer === "none" ? "" : run.scope) }] : []),
  ];
}

function metricColumns(view, metric, rows) {
  const ranks = ranksOf(rows.map(({ row }) => row[metric.key]));
  const columns = [{
    key: metric.key, title: metric.title, hint: metric.hint, number: true,
    value: ({ row }) => row[metric.key],
    class: (one) => ({ 1: "best", 2: "second" })[ranks[rows.indexOf(one)]],
    cell: ({ row }) => shown(row[metric.key]),
  }];
  if (rows.some(({ run }) => gainOf(view.scores, metric.key, run.number))) columns.push(gainColumn(view, metric));
  return columns;
}

function gainColumn(view, metric) {
  const found = ({ run }) => gainOf(view.scores, metric.key, run.number);
  return {
    key: `gain_${metric.key}`, title: "gain %", number: true,
    hint: `Gain in ${metric.title.toLowerCase()} over the tracker alone, in percent of it`,
    value: (one) => (found(one) ? found(one).gain : null),
    class: (one) => `gain ${gainClass(found(one))}`,
    cell: (one) => gainText(found(one)),
  };
}

function gainClass(gain) {
  if (!gain || !isKnown(gain.gain)) return "";
  if (!gain.certain) return "unsure";
  return gain.gain > 0 ? "rise" : "fall";
}

function gainText(gain) {
  if (!gain) return "";
  const text = isKnown(gain.gain) ? signed(gain.gain) : MISSING;
  if (gain.certain) return text;
  return [element("span", { title: "Not told from chance", "aria-label": "uncertain" }, "~\u2009"), text];
}

function speedColumn(rows) {
  if (!rows.some(({ run }) => isKnown(run.speed))) return [];
  return [{ key: "speed", title: "frames/s", number: true, hint: "Enhancing and tracking, as timed in the run",
    value: ({ run }) => run.speed, cell: ({ run }) => shown(run.speed, 1) }];
}

// 1 for the best and 2 for the second of the rows shown, by three decimals.
function ranksOf(values) {
  const texts = values.map((value) => (isKnown(value) ? Number(value.toFixed(3)) : null));
  const order = [...new Set(texts.filter((value) => value !== null))].sort((a, b) => b - a);
  return texts.map((value) => (value === null || values.length < 2 ? 0 : order.indexOf(value) + 1));
}

function legendOfMarks(view, rows) {
  const parts = view.metrics.length ? [] : ["No score has a number under this protocol. "];
  if (rows.length > 1) {
    parts.push(element("span", { class: "best" }, "Bold"), ": best of the rows shown; ",
      element("span", { class: "second" }, "underlined"), ": second. ");
  }
  if (Object.keys(view.scores.gains).length) {
    parts.push("~: could be chance, as the 95 % bootstrap interval over sequences includes no gain, "
      + "or there are too few sequences to tell. ");
  } else {
    parts.push("No gains: they need a tracker both with an enhancer and without. ");
  }
  if (isComputed(view.subset.provenance)) {
    parts.push("\u2020: computed from boxes and pixels, no published label. ");
  }
  parts.push("A row pins its run; the line before it hides its curves.");
  return note(parts);
}
