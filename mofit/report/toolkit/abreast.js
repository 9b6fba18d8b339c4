"use strict";
// A table with a column per run: two are chosen, the others hide, and the last column says how far the two lie apart.
for (const place of document.querySelectorAll(".abreast")) {
  const table = place.parentElement.querySelector("table"), rows = [...table.rows], last = rows[0].cells.length - 1;
  const names = [...rows[0].cells].slice(2, last).map((cell) => cell.textContent.trim());
  const selects = [0, 1].map((which) => {
    const label = document.createElement("label"), select = document.createElement("select");
    names.forEach((name) => select.add(new Option(name, name)));
    select.selectedIndex = which;
    select.addEventListener("change", show);
    label.append(which ? " beside " : "Show ", select);
    place.append(label);
    return select;
  });
  function apart(first, second) {
    const [a, b] = [first, second].map((cell) => cell.querySelector("[data-value]"));
    if (!a || !b) return "";
    const difference = Number(b.dataset.value) - Number(a.dataset.value);
    if (a.dataset.sd && b.dataset.sd) {
      const sd = Math.hypot(Number(a.dataset.sd), Number(b.dataset.sd));
      return sd > 0 ? `${(difference / sd).toFixed(1)} sd`.replace("-", "−") : "";
    }
    const relative = (100 * difference) / Math.abs(Number(a.dataset.value));
    return Number.isFinite(relative) ? `${relative > 0 ? "+" : ""}${relative.toFixed(1)} %`.replace("-", "−") : "";
  }
  function show() {
    const chosen = selects.map((select) => select.selectedIndex + 2);
    for (const [k, row] of rows.entries()) {
      [...row.cells].forEach((cell, column) => { cell.hidden = column > 1 && column < last && !chosen.includes(column); });
      if (k) row.cells[last].textContent = apart(row.cells[chosen[0]], row.cells[chosen[1]]);
    }
  }
  show();
}
