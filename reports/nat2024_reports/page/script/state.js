// What is chosen stands in the address after #, so that every view is a link and "back" works.

const SINGLE = ["dataset", "subset", "protocol", "metric", "cells", "tracker", "enhancer", "find", "light", "run",
  "sequence", "frame"];
const MANY = ["sort", "off"];

function readState() {
  const words = new URLSearchParams(location.hash.slice(1));
  const state = {};
  for (const key of SINGLE) state[key] = words.get(key) || "";
  for (const key of MANY) state[key] = words.getAll(key);
  return state;
}

function addressOf(state) {
  const words = new URLSearchParams();
  for (const key of SINGLE) if (state[key]) words.set(key, state[key]);
  for (const key of MANY) for (const value of state[key]) words.append(key, value);
  return `#${words}`;
}

function linkTo(changes) {
  return addressOf({ ...readState(), ...changes });
}

// A new entry in the history, or for small steps such as typing the same entry.
function choose(changes, { quietly = false } = {}) {
  const address = linkTo(changes);
  if (address === location.hash || (address === "#" && !location.hash)) return;
  if (quietly) {
    history.replaceState(null, "", address);
    render();
  } else {
    location.hash = address;
  }
}

function toggled(list, value) {
  return list.includes(value) ? list.filter((other) => other !== value) : [...list, value];
}

function sortOf(state, table) {
  const found = state.sort.find((text) => text.startsWith(`${table}:`));
  if (!found) return null;
  const [, column, direction] = found.split(":");
  return { column, descending: direction === "down" };
}

// Off, first direction, other direction, off again.
function nextSort(state, table, column, firstDown) {
  const others = state.sort.filter((text) => !text.startsWith(`${table}:`));
  const now = sortOf(state, table);
  const first = firstDown ? "down" : "up";
  const second = firstDown ? "up" : "down";
  if (!now || now.column !== column) return [...others, `${table}:${column}:${first}`];
  if (now.descending === firstDown) return [...others, `${table}:${column}:${second}`];
  return others;
}
