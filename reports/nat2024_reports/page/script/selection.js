// From the state to what is shown: one dataset, one protocol, one set of sequences, some runs.

let DATA = null;
const details = new Map();
const NO_LIGHT = { key: "", title: "", hint: "", decimals: 3 };

function select(state) {
  const datasetNumber = Math.max(0, DATA.datasets.findIndex((one) => one.name === state.dataset));
  const dataset = DATA.datasets[datasetNumber];
  const protocolNumber = Math.max(0, dataset.protocols.findIndex((one) => one.title === state.protocol));
  const protocol = dataset.protocols[protocolNumber];
  const subsetNumber = Math.max(0, dataset.subsets.findIndex((one) => subsetKey(one) === state.subset));
  const metrics = DATA.metrics.filter((one) => protocol.metrics.includes(one.key));
  const metric = metrics.find((one) => one.key === state.metric) || metrics[0] || DATA.metrics[0];
  const filtered = dataset.runs.map((run, number) => ({ ...run, number, label: labelOf(run) }))
    .filter((run) => (!state.tracker || run.tracker === state.tracker)
      && (!state.enhancer || run.enhancer === state.enhancer));
  const visible = filtered.filter((run) => !state.off.includes(run.name));
  const sequence = state.sequence ? dataset.sequences.findIndex((one) => one.name === state.sequence) : -1;
  return {
    light: dataset.light.find((one) => one.key === state.light) || dataset.light[0] || NO_LIGHT,
    state, dataset, datasetNumber, protocol, metrics, metric, runs: filtered, visible, sequence,
    subset: dataset.subsets[subsetNumber],
    scores: protocol.subsets[subsetNumber],
    pinned: dataset.runs.findIndex((run) => run.name === state.run),
    gains: state.cells === "gains" && dataset.runs.some((run) => run.base !== null),
  };
}

function subsetKey(subset) {
  return subset.kind === "all" ? "" : `${subset.kind}:${subset.name}`;
}

function labelOf(run) {
  return run.enhancer === "none" ? run.tracker : `${run.tracker} + ${run.enhancer}`;
}

function subsetTitle(subset) {
  if (subset.kind === "all") return "All sequences";
  const mark = isComputed(subset.provenance) ? "\u2020" : "";
  return `${subset.kind === "attribute" ? "Attribute" : "Category"} ${subset.name}${mark}`;
}

function isComputed(provenance) {
  return provenance === "computed" || provenance === "mixed";
}

function gainOf(scores, metric, run) {
  return (scores.gains[metric] || []).find((one) => one.run === run) || null;
}

// What is read only when a sequence is opened.
function detailOf(view) {
  const key = `${view.datasetNumber}-${view.sequence}`;
  if (!details.has(key)) details.set(key, JSON.parse(byId(`sequence-${key}`).textContent));
  return details.get(key);
}
