"use strict";
(() => {
  function sorting(table) {
    const heads = [...table.tHead.rows[0].cells], body = table.tBodies[0];
    const value = (row, index) => {
      const text = row.cells[index]?.dataset.value ?? "";
      const number = text === "inf" ? Infinity : Number(text);
      return text === "" || Number.isNaN(number) ? text : number;
    };
    const compare = (x, y) => typeof x === "number" && typeof y === "number" ? x - y : String(x).localeCompare(String(y));
    heads.forEach((head, index) => head.querySelector("button")?.addEventListener("click", () => {
      const up = head.getAttribute("aria-sort") !== "ascending";
      for (const one of heads) one.setAttribute("aria-sort", "none");
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      const rows = [...body.rows].sort((a, b) => (up ? 1 : -1) * compare(value(a, index), value(b, index)));
      body.append(...rows);
    }));
  }

  // Words choose the rows whose scene or lecture's numbers have them all, or the columns whose technique has; a verdict
  // what has one like it.
  function filtering(table) {
    const find = document.getElementById("find"), only = document.getElementById("only");
    const heads = [...table.tHead.rows[0].cells].slice(1), rows = [...table.tBodies[0].rows];
    const has = (text, word) => /^[lp]\d+$/.test(word) ? text.split(" ").includes(word) : text.includes(word);
    function filter() {
      const words = find.value.toLowerCase().split(/\s+/).filter(Boolean);
      const inColumns = words.filter((word) => heads.some((head) => has(head.textContent.toLowerCase(), word)));
      const inRows = words.filter((word) => rows.some((row) => has(row.dataset.find.toLowerCase(), word)));
      const columns = heads.map((head) => words.every((word) =>
        !inColumns.includes(word) || inRows.includes(word) || has(head.textContent.toLowerCase(), word)));
      let shown = 0, verdicts = 0;
      for (const row of rows) {
        const cells = [...row.cells].slice(1), right = cells.filter((cell, i) =>
          columns[i] && (only.value ? cell.classList.contains(only.value) : cell.firstElementChild));
        const named = words.every((word) => has(row.dataset.find.toLowerCase(), word) ||
          (inColumns.includes(word) && !inRows.includes(word)));
        row.hidden = !named || (only.value && !right.length);
        cells.forEach((cell, i) => {
          cell.hidden = !columns[i];
          cell.classList.toggle("aside", Boolean(only.value) && !cell.classList.contains(only.value));
        });
        if (!row.hidden) {
          shown += 1;
          verdicts += right.length;
        }
      }
      heads.forEach((head, i) => { head.hidden = !columns[i]; });
      document.getElementById("found").textContent = `${shown} scenes, ${verdicts} verdicts`;
    }
    find.addEventListener("input", filter);
    only.addEventListener("input", filter);
    filter();
  }

  // Details are printed open, and what a link leads to is.
  function opening() {
    const row = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    row?.querySelector("details")?.setAttribute("open", "");
  }

  document.querySelectorAll("table.sortable").forEach(sorting);
  document.querySelectorAll("#matrix").forEach(filtering);
  addEventListener("hashchange", opening);
  opening();
})();
