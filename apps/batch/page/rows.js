// Reads the sheets that the page holds: what `apps/batch/page.py` wrote, in its order.

import { part } from "../../web/viewer/page/elements.js";

/** @typedef {"waiting" | "running" | "done" | "failed" | "quarantined"} SheetState */
/** @typedef {"ok" | "weak" | "ambiguous" | "failed" | ""} Verdict "" where there is none yet */

/**
 * @typedef {object} Head
 * @property {string} title
 * @property {number} written seconds since 1970
 * @property {string | null} results what addresses of results begin with; null: they have none
 * @property {{name: string, results: [string, string][]}[]} stages in order, with words and places of their results
 */

/** @typedef {[string, string, SheetState, Verdict, string, string, number, number, number, number, number, number, number, Verdict, string, number, number]} Values */

/**
 * @typedef {object} Sheet numbers are 0 where they are not known
 * @property {number} position in the batch
 * @property {string} name
 * @property {string} character "" where it is the name
 * @property {SheetState} state
 * @property {Verdict} verdict of its cameras
 * @property {string} reason of the verdict
 * @property {string} error why it failed
 * @property {string} stage that failed
 * @property {number} views
 * @property {number} seconds
 * @property {number} memory MB
 * @property {number} attempts
 * @property {number} done stages that are done, one bit each
 * @property {boolean} overlay whether there is a small picture of it
 * @property {boolean} turntable whether there is one of that
 * @property {Verdict} field verdict of its field
 * @property {string} fieldReason
 * @property {number} colors of its palette
 * @property {number} psnr dB
 * @property {string} text that is searched
 */

/** @returns {Head} */
export function readHead() {
  return JSON.parse(part("head", HTMLElement).textContent ?? "");
}

/**
 * @param {Head} head
 * @returns {Sheet[]}
 */
export function readSheets(head) {
  /** @type {Sheet[]} */
  const sheets = [];
  for (const block of document.querySelectorAll("script.rows")) {
    for (const values of JSON.parse(block.textContent ?? "[]"))
      sheets.push(sheetOf(values, sheets.length, head));
    block.remove(); // its text is in memory twice else
  }
  return sheets;
}

/**
 * @param {Values} values
 * @param {number} position
 * @param {Head} head
 * @returns {Sheet}
 */
function sheetOf(values, position, head) {
  const [name, character, state, verdict, reason, error, failed, views, seconds, memory] = values;
  const [attempts, done, pictures, field, fieldReason, colors, psnr] = values.slice(10);
  return /** @type {Sheet} */ ({
    position,
    ...{ name, character, state, verdict, reason, error, views, seconds, memory },
    ...{ attempts, done, field, fieldReason, colors, psnr },
    stage: head.stages[failed]?.name ?? "",
    overlay: (Number(pictures) & 1) > 0,
    turntable: (Number(pictures) & 2) > 0,
    text: `${name}\n${character}\n${error}`.toLowerCase(),
  });
}
