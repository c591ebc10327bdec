// The table of sheets: one page of rows at a time, so that thousands cost no more than a few.

import { createTurns, overlayOf } from "./pictures.js";
import { SORTED } from "./question.js";
import { amount, STATE_ICONS } from "./summary.js";
import { element, part } from "../../web/viewer/page/elements.js";
import { badge } from "../../web/viewer/page/verdict.js";

/** @typedef {import("./rows.js").Head} Head */
/** @typedef {import("./rows.js").Sheet} Sheet */
/** @typedef {import("./question.js").Column} Column */
/** @typedef {import("./question.js").Question} Question */

const LOG_FILE = "log.txt";
const OWN = "sheets/"; // where logs are, wherever results are

/** @type {Record<Column, string>} */
const TITLES = {
  state: "State",
  name: "Name",
  views: "Views",
  seconds: "Seconds",
  memory: "Memory (MB)",
  attempts: "Attempts",
};

/**
 * @param {Head} head
 * @param {(change: Partial<Question>) => void} ask
 * @returns {(sheets: Sheet[], question: Question) => void} shows one page of rows
 */
export function createTable(head, ask) {
  const headers = createHeaders(ask);
  const turns = createTurns();
  const body = part("rows", HTMLElement);
  return (sheets, question) => {
    headers(question);
    body.replaceChildren(...sheets.map((sheet) => rowOf(sheet, head, turns)));
  };
}

/**
 * @param {(change: Partial<Question>) => void} ask
 * @returns {(question: Question) => void} shows the order
 */
function createHeaders(ask) {
  const columns = part("columns", HTMLElement);
  columns.append(element("th", { scope: "col", role: "columnheader" }, "Pictures"));
  /** @type {Question | null} */
  let now = null;
  const cells = [SORTED[1], SORTED[0], ...SORTED.slice(2)].map((column) => {
    const button = element("button", { type: "button" }, TITLES[column]);
    const cell = element("th", { scope: "col", role: "columnheader", "data-column": column }, button);
    button.addEventListener("click", () =>
      ask({ sort: column, back: now?.sort === column && !now.back }),
    );
    columns.append(cell);
    return cell;
  });
  return (question) => {
    now = question;
    for (const cell of cells) {
      const column = cell.dataset.column;
      const rises = (column === "name" || column === "state") !== question.back;
      if (column !== question.sort) cell.removeAttribute("aria-sort");
      else cell.setAttribute("aria-sort", rises ? "ascending" : "descending");
    }
  };
}

/**
 * @param {Sheet} sheet
 * @param {Head} head
 * @param {(sheet: Sheet, row: HTMLElement) => HTMLElement} turns
 * @returns {HTMLElement}
 */
function rowOf(sheet, head, turns) {
  const row = element("tr", { role: "row" });
  const links = linksOf(sheet, head);
  const pictures = element("td", { role: "cell", class: "pictures" });
  if (sheet.overlay || sheet.turntable) {
    const turntable = links.get("viewer") ?? links.get("turntable");
    pictures.append(linked(overlayOf(sheet), links.get("overlay")));
    pictures.append(linked(turns(sheet, row), turntable));
  }
  row.append(pictures, nameCell(sheet, links), stateCell(sheet));
  row.append(numberCell(sheet.views, amount(sheet.views), "views"));
  row.append(numberCell(sheet.seconds, shortNumber(sheet.seconds), "s"));
  row.append(numberCell(sheet.memory, amount(Math.round(sheet.memory)), "MB"));
  const attempts = sheet.attempts === 1 ? "attempt" : "attempts";
  row.append(numberCell(sheet.attempts, amount(sheet.attempts), attempts));
  return row;
}

/**
 * @param {Sheet} sheet
 * @param {Map<string, string>} links
 * @returns {HTMLElement}
 */
function nameCell(sheet, links) {
  const cell = element("th", { scope: "row", role: "rowheader", class: "named" });
  cell.append(element("bdi", { class: "sheet-name" }, sheet.name));
  if (sheet.character) cell.append(element("bdi", { class: "character" }, sheet.character));
  if (links.size) {
    const items = [...links].map(([word, href]) => {
      const label = `${word} of ${sheet.name}`;
      return element("li", {}, element("a", { href, "aria-label": label }, word));
    });
    cell.append(element("ul", { class: "links", role: "list" }, ...items));
  }
  return cell;
}

/** @param {Sheet} sheet @returns {HTMLElement} */
function stateCell(sheet) {
  const cell = element("td", { role: "cell", class: "state" });
  const icon = element("i", { "aria-hidden": "true" }, STATE_ICONS[sheet.state]);
  const words = sheet.stage ? `${sheet.state} in ${sheet.stage}` : sheet.state;
  const line = element("div", { class: "line" });
  line.append(element("span", { class: "stated", "data-rank": sheet.state }, icon, ` ${words}`));
  if (sheet.verdict) line.append(badge(sheet.verdict, `cameras ${sheet.verdict}`));
  if (sheet.field && sheet.field !== "ok") line.append(badge(sheet.field, `field ${sheet.field}`));
  cell.append(line);
  if (sheet.error) cell.append(element("p", { class: "error", dir: "auto" }, sheet.error));
  for (const reason of [sheet.reason, sheet.field === "ok" ? "" : sheet.fieldReason])
    if (reason) cell.append(element("p", { class: "reason", dir: "auto" }, reason));
  const facts = [];
  if (sheet.colors) facts.push(`${amount(sheet.colors)} ${sheet.colors === 1 ? "colour" : "colours"}`);
  if (sheet.psnr) facts.push(`${sheet.psnr.toFixed(1)} dB`);
  if (facts.length) cell.append(element("p", { class: "note" }, facts.join(", ")));
  return cell;
}

/**
 * @param {number} value 0 where it is not known
 * @param {string} text
 * @param {string} unit that stands beside it where the columns have no titles
 * @returns {HTMLElement}
 */
function numberCell(value, text, unit) {
  const cell = element("td", { role: "cell", class: "number" });
  if (value) cell.append(text, element("span", { class: "unit" }, ` ${unit}`));
  return cell;
}

/** @param {number} value @returns {string} */
function shortNumber(value) {
  return value < 10 ? value.toFixed(1) : amount(Math.round(value));
}

/**
 * @param {Sheet} sheet
 * @param {Head} head
 * @returns {Map<string, string>} words and addresses of what can be looked at
 */
function linksOf(sheet, head) {
  const links = new Map();
  const name = encodeURIComponent(sheet.name);
  head.stages.forEach((stage, rank) => {
    if (head.results === null || !(sheet.done & (1 << rank))) return;
    for (const [word, path] of stage.results)
      links.set(word, `${head.results}${name}/${path.split("/").map(encodeURIComponent).join("/")}`);
  });
  if (sheet.error) links.set("log", `${OWN}${name}/${LOG_FILE}`);
  return links;
}

/**
 * @param {HTMLElement} picture
 * @param {string | undefined} href
 * @returns {HTMLElement} for the mouse only: the row's links say the same in words
 */
function linked(picture, href) {
  if (!href || !picture.hasChildNodes()) return picture;
  return element("a", { href, tabindex: "-1", "aria-hidden": "true" }, picture);
}
