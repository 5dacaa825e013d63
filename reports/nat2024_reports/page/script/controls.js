// The bar of choices: dataset, sequences, trackers, enhancers, protocol, score.

function controls(view) {
  const { state, dataset } = view;
  const names = (key) => [...new Set(dataset.runs.map((run) => run[key]))];
  const parts = [
    DATA.datasets.length > 1 && chooser("Dataset", "dataset", view.dataset.name,
      DATA.datasets.map((one) => [one.name, one.name]), (value) => ({ dataset: value, subset: "", protocol: "",
        tracker: "", enhancer: "", off: [], run: "", sequence: "", frame: "" })),
    view.sequence < 0 && subsetChooser(view),
    names("tracker").length > 1 && chooser("Tracker", "tracker", state.tracker,
      [["", "All trackers"], ...names("tracker").map((name) => [name, name])]),
    names("enhancer").length > 1 && chooser("Enhancer", "enhancer", state.enhancer, [["", "All enhancers"],
      ...names("enhancer").map((name) => [name, name === "none" ? "none (plain tracker)" : name])]),
    dataset.protocols.length > 1 && chooser("Protocol", "protocol", view.protocol.title,
      dataset.protocols.map((one) => [one.title, one.title]),
      (value) => ({ protocol: value === dataset.protocols[0].title ? "" : value })),
    view.metrics.length > 1 && chooser("Score", "metric", view.metric.key,
      view.metrics.map((one) => [one.key, one.title])),
    view.sequence < 0 && dataset.runs.some((run) => run.base !== null) && chooser("Cells", "cells", state.cells,
      [["", "Scores"], ["gains", "Gains"]]),
    view.sequence < 0 && finder(state),
    element("button", {
      type: "button", class: "reset", "data-focus": "reset",
      on: { click: () => { location.hash = addressOf({ ...readState(), ...emptyState(), dataset: state.dataset,
        sequence: state.sequence }); } },
    }, "Reset"),
  ];
  return element("form", { class: "controls", role: "search", "aria-label": "What is shown",
    on: { submit: (event) => event.preventDefault() } }, parts);
}

function emptyState() {
  const state = {};
  for (const key of SINGLE) state[key] = "";
  for (const key of MANY) state[key] = [];
  return state;
}

function chooser(title, key, value, choices, changes) {
  const options = choices.map(([choice, text]) =>
    element("option", { value: choice, selected: choice === value }, text));
  return element("label", {}, title, element("select", {
    name: key, "aria-label": title, "data-focus": `choose-${key}`,
    on: { change: (event) => choose(changes ? changes(event.target.value) : { [key]: event.target.value }) },
  }, options));
}

function subsetChooser(view) {
  const subsets = view.dataset.subsets;
  if (subsets.length < 2) return null;
  const option = (one) => element("option", { value: subsetKey(one), selected: one === view.subset },
    one.kind === "all" ? "All" : one.name, isComputed(one.provenance) && "\u2020", ` (${one.sequences.length})`);
  const group = (kind, title) => {
    const found = subsets.filter((one) => one.kind === kind);
    return found.length > 0 && element("optgroup", { label: title }, found.map(option));
  };
  return element("label", {}, "Sequences", element("select", {
    name: "subset", "aria-label": "Sequences", "data-focus": "choose-subset",
    on: { change: (event) => choose({ subset: event.target.value }) },
  }, option(subsets[0]), group("attribute", "Attribute"), group("category", "Category")));
}

function finder(state) {
  return element("label", {}, "Find a sequence", element("input", {
    type: "search", name: "find", "aria-label": "Find a sequence", value: state.find,
    autocomplete: "off", spellcheck: "false", "data-focus": "find",
    on: { input: (event) => choose({ find: event.target.value }, { quietly: true }) },
  }));
}
