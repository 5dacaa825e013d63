// Tables that can be sorted by every heading and walked with the arrow keys.

// columns: key, title, hint, number, value(row) for sorting, cell(row) for showing, class(row).
// rows: anything; `attributes(row)` are those of its <tr>, `act(row)` is what Enter and a click do.
function sortableTable(view, { name, caption, columns, rows, attributes, act, className = "scores", tall = false }) {
  const sort = sortOf(view.state, name);
  const by = sort && columns.find((column) => column.key === sort.column);
  const ordered = by ? sorted(rows, by.value, sort.descending) : rows;
  const body = element("tbody", { on: { keydown: walk } },
    ordered.map((row, place) => bodyRow(row, place, columns, attributes(row, Boolean(by)), act)));
  const table = element("table", { class: className, "data-table": name },
    caption && element("caption", {}, element("span", {}, caption)),
    element("thead", {}, element("tr", {}, columns.map((column) => headCell(view, name, column, sort)))),
    body);
  return element("div", { class: tall ? "scroll tall" : "scroll", tabindex: tall ? "-1" : null }, table);
}

function sorted(rows, value, descending) {
  const sign = descending ? -1 : 1;
  return [...rows].sort((a, b) => {
    const [x, y] = [value(a), value(b)];
    if (!isKnown(x) || !isKnown(y)) return Number(!isKnown(x)) - Number(!isKnown(y));
    return typeof x === "string" ? sign * x.localeCompare(y, "en", { numeric: true }) : sign * (x - y);
  });
}

function headCell(view, name, column, sort) {
  const attributes = { scope: "col", class: column.number ? "number" : null, title: column.hint, ...column.head };
  if (!column.value) return element("th", attributes, column.title);
  const isSorted = sort && sort.column === column.key;
  attributes["aria-sort"] = isSorted ? (sort.descending ? "descending" : "ascending") : "none";
  const button = element("button", {
    type: "button", class: "sort", "data-focus": `sort-${name}-${column.key}`,
    on: { click: () => choose({ sort: nextSort(view.state, name, column.key, Boolean(column.number)) }) },
  }, column.title);
  return element("th", attributes, button);
}

function bodyRow(row, place, columns, attributes, act) {
  const { focus, ...others } = attributes;
  const walkable = act ? { tabindex: place === 0 ? "0" : "-1", "data-focus": focus } : {};
  const node = element("tr", { ...walkable, ...others }, columns.map((column, number) => {
    const classes = [column.number && "number", column.class && column.class(row)].filter(Boolean).join(" ");
    const tag = number === 0 && column.isHead ? "th" : "td";
    const run = column.run === undefined ? null : column.run;
    const scope = tag === "th" ? "row" : null;
    return element(tag, { class: classes || null, scope, "data-run": run }, column.cell(row));
  }));
  if (act) {
    node.addEventListener("click", () => act(row));
    node.addEventListener("keydown", (event) => {
      if (event.target !== node || (event.key !== "Enter" && event.key !== " ")) return;
      event.preventDefault();
      act(row);
    });
  }
  return node;
}

// Arrow keys, Home and End move the focus among the rows; one row at a time is in the tab order.
function walk(event) {
  const row = event.target.closest("tr[tabindex]");
  if (!row || event.target !== row) return;
  const rows = [...row.parentNode.querySelectorAll("tr[tabindex]")];
  const place = rows.indexOf(row);
  const places = { ArrowDown: place + 1, ArrowUp: place - 1, Home: 0, End: rows.length - 1 };
  if (!(event.key in places)) return;
  event.preventDefault();
  const next = rows[Math.max(0, Math.min(rows.length - 1, places[event.key]))];
  row.tabIndex = -1;
  next.tabIndex = 0;
  next.focus();
}
