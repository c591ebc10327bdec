// What calibration and run say of themselves, in words.

import { element, part } from "./elements.js";

/** @typedef {import("./types.js").ViewRecord} ViewRecord */

/** @type {Record<string, {icon: string, word: string, means: string}>} */
export const VERDICTS = {
  ok: { icon: "✓", word: "ok", means: "The camera is certain." },
  weak: { icon: "~", word: "weak", means: "There is little evidence for this camera." },
  ambiguous: { icon: "?", word: "ambiguous", means: "Another camera fits as well." },
  failed: { icon: "✕", word: "failed", means: "No camera fits this drawing." },
  "": { icon: "–", word: "not rated", means: "No calibration says how certain this camera is." },
};

const RUN_WORDS = new Map([
  ["ok", "The views fit the drawings"],
  ["weak", "Some views may look wrong"],
  ["failed", "Views between drawings are guesses"],
]);

/**
 * @param {{state: string, reasons: string[]} | null} verdict of the run
 */
export function showVerdict(verdict) {
  const place = part("verdict", HTMLElement);
  if (!verdict) return;
  place.append(badge(verdict.state, RUN_WORDS.get(verdict.state) ?? verdict.state));
  if (verdict.reasons.length) {
    const reasons = verdict.reasons.map((reason) => element("li", { dir: "auto" }, reason));
    place.append(element("ul", {}, ...reasons));
  }
  place.hidden = false;
}

/**
 * @param {string} state
 * @param {string} word
 * @returns {HTMLElement} colour, icon and word
 */
export function badge(state, word) {
  const known = Object.hasOwn(VERDICTS, state) ? state : "";
  const icon = element("span", { "aria-hidden": "true" }, VERDICTS[known].icon);
  return element("span", { class: "badge", "data-verdict": known }, icon, element("bdi", {}, word));
}

/**
 * @param {Pick<ViewRecord, "verdict" | "reason">} view
 * @returns {string} why its verdict is what it is
 */
export function reasonOf(view) {
  return view.reason || (VERDICTS[view.verdict] ?? VERDICTS[""]).means;
}
