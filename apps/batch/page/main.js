// Starts the page.

import { countSheets, createAnswers, firstQuestion, hashOfQuestion, questionOfHash } from "./question.js";
import { readHead, readSheets } from "./rows.js";
import { amount, createSummary } from "./summary.js";
import { createTable } from "./table.js";
import { copyText, part, say } from "../../web/viewer/page/elements.js";

/** @typedef {import("./question.js").Question} Question */

const ROWS_OF_PAGE = 50;
const CALM_MS = 250; // after the last change, before the address is written

const head = readHead();
const sheets = readSheets(head);
const counts = countSheets(sheets);
const answers = createAnswers(sheets);
const find = part("find", HTMLInputElement);
const pageNumber = part("page", HTMLInputElement);
const count = part("count", HTMLElement);

let question = questionOfHash(location.hash);
let timer = 0;

const showFilters = createSummary(counts, (change) => ask(change));
const showRows = createTable(head, (change) => ask(change));

/** @param {Partial<Question>} change anything but another page begins with the first page */
function ask(change) {
  question = { ...question, page: 1, ...change };
  show();
  clearTimeout(timer);
  timer = setTimeout(writeAddress, CALM_MS);
}

function show() {
  const found = answers(question);
  const pages = Math.max(1, Math.ceil(found.length / ROWS_OF_PAGE));
  question.page = Math.min(question.page, pages);
  const first = (question.page - 1) * ROWS_OF_PAGE;
  const shown = found.slice(first, first + ROWS_OF_PAGE);
  showFilters(question);
  showRows(shown, question);
  if (find.value !== question.find) find.value = question.find;
  part("clear", HTMLElement).hidden = !isFiltered();
  part("turn", HTMLElement).hidden = !sheets.some((sheet) => sheet.turntable);
  part("sheets", HTMLElement).hidden = !found.length;
  part("pages", HTMLElement).hidden = pages === 1;
  part("previous", HTMLButtonElement).disabled = question.page === 1;
  part("next", HTMLButtonElement).disabled = question.page === pages;
  pageNumber.max = String(pages);
  pageNumber.value = String(question.page);
  part("last", HTMLElement).textContent = `of ${amount(pages)}`;
  const none = part("none", HTMLElement);
  none.hidden = found.length > 0;
  none.textContent = sheets.length ? "No sheet is like that." : "This batch has no sheets yet.";
  count.textContent = found.length ? countLine(first, shown.length, found.length) : "";
}

/** @returns {boolean} */
function isFiltered() {
  return Boolean(question.find || question.states.length || question.verdicts.length);
}

/**
 * @param {number} first
 * @param {number} length
 * @param {number} all that are found
 * @returns {string}
 */
function countLine(first, length, all) {
  const of = all === sheets.length ? "" : `, of ${amount(sheets.length)} in all`;
  if (length === all) return `${sheetCount(all)}${of}`;
  return `${amount(first + 1)} to ${amount(first + length)} of ${sheetCount(all)}${of}`;
}

/** @param {number} number @returns {string} */
function sheetCount(number) {
  return `${amount(number)} ${number === 1 ? "sheet" : "sheets"}`;
}

/** @returns {string} */
function address() {
  const hash = hashOfQuestion(question);
  return location.href.split("#")[0] + (hash ? `#${hash}` : "");
}

function writeAddress() {
  clearTimeout(timer);
  try {
    if (address() !== location.href) history.replaceState(null, "", address());
  } catch {
    // some places where pages are embedded have no history
  }
}

/** @param {number} page */
function turnTo(page) {
  ask({ page });
  count.focus({ preventScroll: true });
  count.scrollIntoView();
}

function showWritten() {
  const when = new Date(head.written * 1000).toLocaleString();
  const left = (counts.states.get("running") ?? 0) + (counts.states.get("waiting") ?? 0);
  const more = left ? `; ${amount(left)} to come: reload the page for news` : "";
  part("written", HTMLElement).textContent = `${sheetCount(sheets.length)}, as of ${when}${more}`;
}

part("summary", HTMLElement).hidden = !sheets.length;
part("title", HTMLElement).textContent = head.title;
showWritten();
find.addEventListener("input", () => ask({ find: find.value }));
part("clear", HTMLElement).addEventListener("click", () => {
  const { sort, back } = question;
  ask({ ...firstQuestion(), sort, back });
  find.focus();
});
part("previous", HTMLElement).addEventListener("click", () => turnTo(question.page - 1));
part("next", HTMLElement).addEventListener("click", () => turnTo(question.page + 1));
pageNumber.addEventListener("change", () => turnTo(Math.max(1, Math.round(Number(pageNumber.value)) || 1)));
part("copy_link", HTMLElement).addEventListener("click", () => copyText(address(), "The link is copied."));
addEventListener("pointerdown", ({ target }) => target !== part("message", HTMLElement) && say(""));
addEventListener("hashchange", () => {
  question = questionOfHash(location.hash);
  show();
});
show();
Object.assign(globalThis, { toonset: { sheets, question: () => question } });
