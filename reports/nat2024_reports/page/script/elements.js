// Elements are made from names, attributes and text nodes: no text is ever read as HTML.

const SVG_SPACE = "http://www.w3.org/2000/svg";
const INK = 8; // the colour of text: a tracker alone beside several enhancers

function element(tag, attributes, ...children) {
  return filled(document.createElement(tag), attributes, children);
}

function drawn(tag, attributes, ...children) {
  return filled(document.createElementNS(SVG_SPACE, tag), attributes, children);
}

// `on` holds listeners; attributes that are null, undefined or false are left out.
function filled(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes || {})) {
    if (name === "on") {
      for (const [event, listener] of Object.entries(value)) node.addEventListener(event, listener);
    } else if (value !== null && value !== undefined && value !== false) {
      node.setAttribute(name, value === true ? "" : String(value));
    }
  }
  for (const child of children.flat(Infinity)) {
    if (child !== null && child !== undefined && child !== false) node.append(child);
  }
  return node;
}

function section(id, title, ...children) {
  return element("section", { id: `part-${id}`, "aria-labelledby": `title-${id}` },
    element("h2", { id: `title-${id}` }, title), children);
}

function note(...words) {
  return element("p", { class: "note" }, words);
}

// A name from outside; <bdi> keeps letters that run from right to left from turning its neighbours.
function named(text) {
  return element("bdi", { class: "name" }, text);
}

function byId(id) {
  return document.getElementById(id);
}
