// Tips on hover and focus, the pair matrix by keyboard, tables that can be sorted.

const tip = document.getElementById("tip");

function tipText(element) {
  if (element.dataset.tip) return element.dataset.tip;
  const meaning = document.querySelector(`#def-${element.dataset.def} dd`);
  return meaning ? meaning.textContent : "";
}

function showTip(element) {
  const text = tipText(element);
  if (!text) return;
  tip.textContent = text;
  tip.of = element;
  tip.hidden = false;
  const from = element.getBoundingClientRect(), size = tip.getBoundingClientRect();
  const left = Math.min(Math.max(8, from.left + from.width / 2 - size.width / 2), innerWidth - size.width - 8);
  const above = from.top - size.height - 8;
  tip.style.left = `${Math.max(8, left)}px`;
  tip.style.top = `${above > 8 ? above : Math.min(from.bottom + 8, innerHeight - size.height - 8)}px`;
}

function hideTip() { tip.hidden = true; }

// Going to an element by keyboard scrolls to it; its tip goes along.
function afterScroll() {
  const at = document.activeElement?.closest?.("[data-tip], [data-def]");
  if (at && at === tip.of) showTip(at); else hideTip();
}

// Titles work without this script; with it they also show on focus and on touch.
for (const element of document.querySelectorAll("main [title], header [title]")) {
  element.dataset.tip = element.getAttribute("title");
  element.removeAttribute("title");
}
for (const title of document.querySelectorAll("svg title")) {
  title.parentNode.dataset.tip = title.textContent;
  title.remove();
}
const tipped = (event) => event.target.closest?.("[data-tip], [data-def]");
document.addEventListener("pointerover", (event) => { const at = tipped(event); if (at) showTip(at); else hideTip(); });
document.addEventListener("focusin", (event) => { const at = tipped(event); if (at) showTip(at); });
document.addEventListener("focusout", hideTip);
document.addEventListener("scroll", afterScroll, { passive: true, capture: true });
document.addEventListener("keydown", (event) => { if (event.key === "Escape") hideTip(); });
for (const term of document.querySelectorAll(".term")) term.setAttribute("aria-describedby", `def-${term.dataset.def}`);

const pairs = JSON.parse(document.getElementById("pairs-data").textContent);
const matrix = document.getElementById("matrix");
const detail = document.getElementById("pair-detail");
const percent = (value) => `${(100 * value).toFixed(1)} %`;

function pairDetail(pair) {
  const shown = (value, digits) => (value === null ? "–" : value.toPrecision(digits));
  const kind = pair.kind + (pair.sliding === null ? "" : ` (${pair.sliding})`);
  const lines = [
    `${pair.i} – ${pair.j}: ${pair.accepted ? "accepted" : "not accepted"}; alone: ${kind}`,
    `score ${shown(pair.score, 3)}, overlap ${percent(pair.overlap)}, margin ${shown(pair.margin, 3)}, observability ${shown(pair.observability, 2)}`
      + (pair.confidence === null ? "" : `, confidence ${percent(pair.confidence)}`),
  ];
  if (pair.evidence) lines.push(Object.entries(pair.evidence).map(([key, value]) => `${key} ${percent(value)}`).join(", "));
  if (pair.reason) lines.push(pair.reason);
  return lines.join("\n");
}

const cells = matrix ? [...matrix.querySelectorAll("td[data-pair]")] : [];
if (cells.length) cells[0].tabIndex = 0;
for (const cell of cells) {
  const tell = () => { detail.textContent = pairDetail(pairs[cell.dataset.pair]); };
  cell.addEventListener("pointerenter", tell);
  cell.addEventListener("focus", tell);
}
matrix?.addEventListener("keydown", (event) => {
  const [rows, columns] = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] }[event.key] ?? [0, 0];
  const cell = event.target.closest("td");
  if (!cell || (!rows && !columns)) return;
  event.preventDefault();
  let row = cell.parentNode.rowIndex, column = cell.cellIndex, next;
  do {  // past the diagonal
    row += rows;
    column += columns;
    next = matrix.rows[row]?.cells[column];
  } while (next && next.tagName === "TD" && !next.dataset.pair);
  if (!next?.dataset.pair) return;
  cell.tabIndex = -1;
  next.tabIndex = 0;
  next.focus();
});

function sortBy(table, column, descending) {
  const key = (row) => { const cell = row.cells[column]; return cell.dataset.value ?? cell.textContent.trim(); };
  const rows = [...table.tBodies[0].rows];
  const order = (a, b) => {
    const [x, y] = [key(a), key(b)];
    if (x === "" || y === "") return (x === "") - (y === "");  // the unknown last, either way
    const numbers = Number(x) - Number(y);
    const sign = Number.isNaN(numbers) ? x.localeCompare(y, "en", { numeric: true }) : numbers;
    return descending ? -sign : sign;
  };
  table.tBodies[0].append(...rows.sort(order));
}

const table = document.getElementById("scan-table");
[...table.tHead.rows[0].cells].forEach((head, column) => {
  const button = document.createElement("button");
  button.type = "button";
  button.setAttribute("aria-label", `sort by ${head.textContent}`);
  head.append(" ", button);
  button.addEventListener("click", () => {
    const descending = head.getAttribute("aria-sort") === "ascending";
    for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", descending ? "descending" : "ascending");
    sortBy(table, column, descending);
  });
});

if (document.getElementById("scene")) startViewer();
