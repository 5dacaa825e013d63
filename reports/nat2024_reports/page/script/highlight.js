// One run at a time stands out, in every table and curve at once; a pinned one does so until unpinned.

let pinnedRun = -1;

function light(run) {
  const number = run === null ? pinnedRun : run;
  for (const node of document.querySelectorAll(".lit")) node.classList.remove("lit");
  document.body.classList.toggle("has-lit", number >= 0);
  if (number < 0) return;
  for (const node of document.querySelectorAll(`[data-run="${number}"]`)) node.classList.add("lit");
}

function lighting(run) {
  return {
    pointerenter: () => light(run),
    pointerleave: () => light(null),
    focusin: () => light(run),
    focusout: () => light(null),
  };
}

function pin(view, run) {
  choose({ run: view.state.run === run.name ? "" : run.name });
}

function sample(run) {
  return drawn("svg", { class: `key c${run.color}`, viewBox: "0 0 32 10", "aria-hidden": "true" },
    drawn("path", { class: `d${run.dash}`, d: "M1 5H31" }));
}

function toggleButton(view, run) {
  const isOn = !view.state.off.includes(run.name);
  return element("button", {
    type: "button", class: "toggle", "aria-pressed": isOn, "data-focus": `toggle-${run.number}`,
    "aria-label": `Show ${run.label} in the curves`, title: isOn ? "Hide in the curves" : "Show in the curves",
    on: {
      click: (event) => {
        event.stopPropagation();
        choose({ off: toggled(view.state.off, run.name) });
      },
      keydown: (event) => { if (event.key === "Enter" || event.key === " ") event.stopPropagation(); },
    },
  }, sample(run));
}
