{
  const search = document.querySelector("#search"), shown = document.querySelector("#shown");
  const rows = [...document.querySelectorAll("tbody tr, figure[data-name]")];
  const filter = () => {
    const words = search.value.toLowerCase().split(/\s+/);
    let n = 0;
    for (const row of rows) {
      const text = (row.dataset.name ?? row.textContent).toLowerCase();
      row.hidden = !words.every((word) => text.includes(word));
      n += !row.hidden && row.tagName === "TR";
    }
    for (const details of document.querySelectorAll("details")) if (search.value) details.open = true;
    shown.textContent = search.value ? `${n} rows` : "";
  };
  search.addEventListener("input", filter);
  const value = (row, column) => row.cells[column].textContent.trim();
  // Durations are in the largest unit of which there is one.
  const seconds = { s: 1, min: 60, h: 3600, days: 86400 };
  const size = (text) => {
    const [, number, unit] = /^([+-]?[\d.]+)(?: (s|min|h|days)$)?/.exec(text.endsWith("UTC") ? "" : text) ?? [];
    return parseFloat(number) * (seconds[unit] ?? 1);
  };
  const compare = (a, b) => {
    const [x, y] = [size(a), size(b)];
    if (Number.isNaN(x) && Number.isNaN(y)) return a.localeCompare(b);
    return Number.isNaN(x) ? 1 : Number.isNaN(y) ? -1 : x - y;
  };
  for (const head of document.querySelectorAll("th")) {
    head.tabIndex = 0;
    const sort = () => {
      const body = head.closest("table").tBodies[0];
      const rises = head.ariaSort !== "ascending";
      for (const other of head.parentNode.children) other.ariaSort = "none";
      head.ariaSort = rises ? "ascending" : "descending";
      const order = rises ? 1 : -1;
      body.append(...[...body.rows].sort((a, b) => order * compare(value(a, head.cellIndex), value(b, head.cellIndex))));
    };
    head.addEventListener("click", sort);
    head.addEventListener("keydown", (event) => event.key === "Enter" && sort());
  }
  if (location.hash) {
    search.value = decodeURIComponent(location.hash.slice(1));
    filter();
  }
}
