// How many sheets are in which state and have which verdict; each count is a filter.

import { CAMERAS, RANK_NAMES, STATES } from "./question.js";
import { element, part } from "../../web/viewer/page/elements.js";
import { VERDICTS } from "../../web/viewer/page/verdict.js";

/** @typedef {import("./question.js").Question} Question */
/** @typedef {import("./question.js").Counts} Counts */

/** @type {Record<import("./rows.js").SheetState, string>} */
export const STATE_ICONS = { quarantined: "⊘", failed: "✕", done: "✓", running: "▸", waiting: "…" };

/**
 * @param {Counts} counts
 * @param {(change: Partial<Question>) => void} ask
 * @returns {(question: Question) => void} shows which filters are on
 */
export function createSummary(counts, ask) {
  showStrip(counts.ranks);
  const icons = Object.fromEntries(CAMERAS.map((verdict) => [verdict, VERDICTS[verdict].icon]));
  const states = filters("states", STATES, counts.states, STATE_ICONS, (states) => ask({ states }));
  const verdicts = filters("verdicts", CAMERAS, counts.verdicts, icons, (verdicts) =>
    ask({ verdicts }),
  );
  return (question) => {
    states(question.states);
    verdicts(question.verdicts);
  };
}

/**
 * @template {string} T
 * @param {string} id of the group
 * @param {T[]} words
 * @param {Map<T, number>} counts
 * @param {Record<string, string>} icons
 * @param {(chosen: T[]) => void} choose
 * @returns {(chosen: T[]) => void} shows which are chosen
 */
function filters(id, words, counts, icons, choose) {
  const group = part(id, HTMLElement);
  const inputs = words.map((word) => {
    const input = element("input", { type: "checkbox", value: word });
    const icon = element("i", { "aria-hidden": "true", "data-rank": word }, icons[word]);
    const count = element("b", {}, amount(counts.get(word) ?? 0));
    group.append(element("label", {}, input, element("span", {}, icon, ` ${word} `, count)));
    input.addEventListener("change", () => choose(words.filter((_, i) => inputs[i].checked)));
    return input;
  });
  return (chosen) => {
    words.forEach((word, i) => {
      inputs[i].checked = chosen.includes(word);
      const label = inputs[i].parentElement;
      if (label) label.hidden = !counts.get(word) && !inputs[i].checked;
    });
    group.hidden = words.every((word) => !counts.get(word) && !chosen.includes(word));
  };
}

/** @param {number[]} ranks how many sheets each has */
function showStrip(ranks) {
  const strip = part("strip", HTMLElement);
  strip.hidden = ranks.every((count) => !count);
  ranks.forEach((count, rank) => {
    if (!count) return;
    const share = element("span", { "data-rank": RANK_NAMES[rank] });
    share.style.flexGrow = String(count);
    strip.append(share);
  });
}

/** @param {number} count @returns {string} */
export function amount(count) {
  return count.toLocaleString("en");
}
