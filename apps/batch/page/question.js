// What a reader asks for, the sheets that answer it, and the address that holds it.

/** @typedef {import("./rows.js").Sheet} Sheet */
/** @typedef {import("./rows.js").SheetState} SheetState */
/** @typedef {import("./rows.js").Verdict} Verdict */
/** @typedef {"state" | "name" | "views" | "seconds" | "memory" | "attempts"} Column */

/**
 * @typedef {object} Question
 * @property {string} find words that are all in a sheet's name, character or error
 * @property {SheetState[]} states any of them; none: all
 * @property {Verdict[]} verdicts any of them; none: all
 * @property {Column} sort
 * @property {boolean} back whether the order is turned round
 * @property {number} page from 1
 */

/** @typedef {{states: Map<SheetState, number>, verdicts: Map<Verdict, number>, ranks: number[]}} Counts */

/** @type {SheetState[]} */
export const STATES = ["quarantined", "failed", "done", "running", "waiting"];
/** @type {Verdict[]} */
export const CAMERAS = ["failed", "ambiguous", "weak", "ok"];
/** @type {Column[]} */
export const SORTED = ["state", "name", "views", "seconds", "memory", "attempts"];
const MOST_LETTERS = 200;

/** What is looked at first: ranks of states, and of verdicts of what is done. */
export const RANK_NAMES = ["quarantined", "failed", "cameras-failed", "ambiguous", "weak", "ok", "running", "waiting"];

/** @param {Sheet} sheet @returns {number} its place in RANK_NAMES */
export function rankOf({ state, verdict }) {
  if (state !== "done") return RANK_NAMES.indexOf(state);
  if (verdict === "failed") return 2;
  return RANK_NAMES.indexOf(verdict || "ok");
}

/** @returns {Question} at the start: what went wrong comes first */
export function firstQuestion() {
  return { find: "", states: [], verdicts: [], sort: "state", back: false, page: 1 };
}

/**
 * @param {Sheet[]} sheets
 * @returns {Counts}
 */
export function countSheets(sheets) {
  const states = new Map(STATES.map((state) => [state, 0]));
  const verdicts = new Map(CAMERAS.map((verdict) => [verdict, 0]));
  const ranks = RANK_NAMES.map(() => 0);
  for (const sheet of sheets) {
    states.set(sheet.state, (states.get(sheet.state) ?? 0) + 1);
    if (sheet.verdict) verdicts.set(sheet.verdict, (verdicts.get(sheet.verdict) ?? 0) + 1);
    ranks[rankOf(sheet)] += 1;
  }
  return { states, verdicts, ranks };
}

/**
 * @param {Sheet[]} sheets
 * @returns {(question: Question) => Sheet[]} which sheets answer it, in its order
 */
export function createAnswers(sheets) {
  /** @type {Map<string, Sheet[]>} */
  const orders = new Map();

  /** @param {Question} question @returns {Sheet[]} */
  function ordered({ sort, back }) {
    const key = `${sort} ${back}`;
    const known = orders.get(key) ?? sortedSheets(sheets, sort, back);
    orders.set(key, known);
    return known;
  }

  return (question) => {
    const words = question.find.toLowerCase().split(/\s+/).filter(Boolean);
    const { states, verdicts } = question;
    return ordered(question).filter(
      (sheet) =>
        (!states.length || states.includes(sheet.state)) &&
        (!verdicts.length || verdicts.includes(sheet.verdict)) &&
        words.every((word) => sheet.text.includes(word)),
    );
  };
}

/**
 * @param {Sheet[]} sheets
 * @param {Column} sort
 * @param {boolean} back
 * @returns {Sheet[]} numbers from the largest, what has none at the end; equals as in the batch
 */
function sortedSheets(sheets, sort, back) {
  const sign = back ? -1 : 1;
  if (sort === "name") {
    const keys = sheets.map((sheet) => nameKey(sheet.name));
    return [...sheets].sort((a, b) => {
      const [one, other] = [keys[a.position], keys[b.position]];
      return one < other ? -sign : one > other ? sign : a.position - b.position;
    });
  }
  if (sort === "state") {
    const ranks = sheets.map(rankOf);
    return [...sheets].sort(
      (a, b) => sign * (ranks[a.position] - ranks[b.position]) || a.position - b.position,
    );
  }
  const value = (/** @type {Sheet} */ sheet) => sheet[sort] || (back ? Infinity : -Infinity);
  return [...sheets].sort((a, b) => {
    const [one, other] = [value(a), value(b)];
    return one === other ? a.position - b.position : sign * (other - one);
  });
}

/** @param {string} name @returns {string} in whose order "a2" comes before "a10" */
function nameKey(name) {
  return name.toLowerCase().replace(/\d+/g, (digits) => digits.padStart(12, "0"));
}

/**
 * @param {Question} question
 * @returns {string} without "#"; empty at the start
 */
export function hashOfQuestion(question) {
  const start = firstQuestion();
  const words = new URLSearchParams();
  if (question.find.trim()) words.set("find", question.find.trim());
  if (question.states.length) words.set("state", question.states.join(","));
  if (question.verdicts.length) words.set("cameras", question.verdicts.join(","));
  if (question.sort !== start.sort) words.set("sort", question.sort);
  if (question.back) words.set("back", "1");
  if (question.page > 1) words.set("page", String(question.page));
  return words.toString().replaceAll("%2C", ",");
}

/**
 * @param {string} hash with or without "#"
 * @returns {Question} what it leaves out or garbles is as at the start
 */
export function questionOfHash(hash) {
  const words = new URLSearchParams(hash.replace(/^#/, ""));
  const said = (/** @type {string} */ name) => (words.get(name) ?? "").split(",");
  const page = words.get("page") ?? "";
  return {
    find: (words.get("find") ?? "").slice(0, MOST_LETTERS),
    states: STATES.filter((state) => said("state").includes(state)),
    verdicts: CAMERAS.filter((verdict) => said("cameras").includes(verdict)),
    sort: SORTED.find((column) => column === words.get("sort")) ?? "state",
    back: words.get("back") === "1",
    page: /^[1-9]\d{0,6}$/.test(page) ? Number(page) : 1,
  };
}
