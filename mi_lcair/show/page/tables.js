// Tables that a click on a heading sorts; long ones are turned page by page.
const ROWS = 25;  // rows of a page of a long table

/** Mark the heading by which a table is sorted; returns whether the order is now descending. */
function turned(heads, head, first) {
  const descending = head.getAttribute("aria-sort") ? head.getAttribute("aria-sort") === "ascending" : first;
  heads.forEach((one) => one.removeAttribute("aria-sort"));
  head.setAttribute("aria-sort", descending ? "descending" : "ascending");
  return descending;
}

/** Order of two cells: numbers by size, texts by letter, and what has no value last. */
function compared(a, b, descending) {
  const [x, y] = [a, b].map((value) => typeof value === "number" && Number.isNaN(value));
  if (x || y) return x - y;
  const order = typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b));
  return descending ? -order : order;
}

function makeSortable(table) {
  const heads = [...table.tHead.rows[0].cells], body = table.tBodies[0];
  const value = (row, k) => {
    const text = row.cells[k].textContent.trim(), number = Number(text.split(" ")[0]);
    return text === NO_VALUE ? NaN : text !== "" && Number.isFinite(number) ? number : text;
  };
  heads.forEach((head, k) => head.addEventListener("click", () => {
    const descending = turned(heads, head, false);
    body.append(...[...body.rows].sort((a, b) => compared(value(a, k), value(b, k), descending)));
  }));
}

PANELS.table = (place, data) => {
  const { columns } = data, count = columns[0].values.length;
  const value = (k, row) => (columns[k].names ? columns[k].names[columns[k].values[row]] : columns[k].values[row]);
  const whole = columns.map(({ values, names }) => !names && values.every(Number.isInteger));
  const cell = (k, row) => (columns[k].names || (whole[k] && Math.abs(value(k, row)) < 1e7) ? String(value(k, row)) : shown(value(k, row)));
  let order = Array.from({ length: count }, (_, row) => row), page = 0;
  const body = element("tbody"), where = element("span");
  const draw = () => {
    const pages = Math.max(1, Math.ceil(count / ROWS));
    page = Math.min(Math.max(page, 0), pages - 1);
    where.textContent = `rows ${page * ROWS + 1} to ${Math.min(count, (page + 1) * ROWS)} of ${count}`;
    body.replaceChildren(...order.slice(page * ROWS, (page + 1) * ROWS).map((row) => element("tr", {},
      ...columns.map((column, k) => element("td", { className: column.names ? "" : "number", textContent: cell(k, row) })))));
  };
  const heads = columns.map(({ title, unit }) => element("th", { scope: "col" }, title, " ", element("span", { className: "unit", textContent: unit })));
  const sort = (k, first) => {
    const descending = turned(heads, heads[k], first);
    order.sort((a, b) => compared(value(k, a), value(k, b), descending));
    page = 0;
    draw();
  };
  heads.forEach((head, k) => head.addEventListener("click", () => sort(k, !columns[k].names)));
  place.append(
    element("div", { className: "wide" }, element("table", { className: "sortable" }, element("thead", {}, element("tr", {}, ...heads)), body)),
    element("div", { className: "controls" }, button("first", () => { page = 0; draw(); }), button("previous", () => { page--; draw(); }), where,
      button("next", () => { page++; draw(); }), button("last", () => { page = Infinity; draw(); })));
  const first = columns.findIndex(({ name }) => name === data.sort);
  if (first >= 0) sort(first, true);
  else draw();
};
