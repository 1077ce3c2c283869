// Tables that can be sorted by a column, and plots that become large when clicked.
"use strict";
for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => head.querySelector("button").addEventListener("click", () => {
    const down = head.getAttribute("aria-sort") === "ascending";
    heads.forEach((other) => other.removeAttribute("aria-sort"));
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const key = (row) => {
      const cell = row.cells[column], data = cell.querySelector("data");
      return data ? parseFloat(data.value) : cell.textContent;
    };
    const order = (a, b) => {
      const [x, y] = [key(a), key(b)], numbers = typeof x === "number" && typeof y === "number";
      // What is not there comes last, whichever way.
      if (x === "" || y === "") return (x === "") - (y === "");
      const less = numbers ? x - y : String(x).localeCompare(String(y), undefined, { numeric: true });
      return down ? -less : less;
    };
    table.tBodies[0].append(...[...table.tBodies[0].rows].sort(order));
  }));
}
for (const picture of document.querySelectorAll("figure img")) {
  picture.addEventListener("click", () => picture.parentElement.classList.toggle("large"));
}
