// Where targets were lost, and the light then.

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
