// The groups of equal figures that were seen on the sheet, and their rows: a click takes another one.

import { withGroup } from "./corrections.js";
import { element, part } from "../../viewer/page/elements.js";

/** @typedef {import("./types.js").Box} Box */

const HIGH = 112; // pixels of a thumbnail, two per pixel of the page
const WIDEST = 640;

/**
 * @param {import("./model.js").Model} model
 * @param {HTMLImageElement} picture the sheet
 */
export function createGroups(model, picture) {
  const strip = part("groups", HTMLElement);
  /** @type {{button: HTMLButtonElement, group: number, outfit: string}[]} */
  let choices = [];
  let shown = "";

  /** @param {Box[][]} rows @param {string} word @param {number} group @param {string} outfit */
  function choice(rows, word, group, outfit) {
    const button = element("button", { type: "button" }, thumbnail(picture, rows), word);
    button.addEventListener("click", () => model.change(withGroup(model.scene, model.said, group, outfit)));
    return { button, group, outfit };
  }

  function show() {
    const { groups } = model.scene;
    if (JSON.stringify(groups) !== shown) {
      shown = JSON.stringify(groups);
      choices = groups.flatMap(({ rows, why, outfits }, i) => [
        choice(rows, why, i + 1, ""),
        ...(rows.length < 2 ? [] : rows).map((row, j) => {
          const letter = String.fromCharCode(65 + j);
          return choice([row], `${outfits ? "Outfit" : "Row"} ${letter}`, i + 1, letter);
        }),
      ]);
      strip.replaceChildren(...choices.map(({ button }) => element("li", {}, button)));
    }
    const { boxes, group = 1, outfit = "" } = model.said;
    for (const one of choices) {
      const taken = !boxes && one.group === group && one.outfit === outfit;
      one.button.setAttribute("aria-pressed", String(taken));
    }
  }

  model.listen(show);
  show();
}

/** @param {HTMLImageElement} picture @param {Box[][]} rows @returns {HTMLCanvasElement} their figures, row by row */
export function thumbnail(picture, rows) {
  const high = HIGH / rows.length;
  const scales = rows.map((row) => high / Math.max(...row.map((box) => box[3])));
  const wide = Math.max(...rows.map((row, i) => scales[i] * row.reduce((sum, box) => sum + box[2], 0)));
  const fit = Math.min(1, WIDEST / wide);
  const canvas = element("canvas", { width: String(Math.ceil(fit * wide)), height: String(Math.ceil(fit * HIGH)), "aria-hidden": "true" });
  const context = canvas.getContext("2d");
  rows.forEach((row, i) => {
    const scale = fit * scales[i];
    let x = 0;
    for (const [left, top, width, height] of row) {
      const y = fit * high * (i + 1) - scale * height;
      context?.drawImage(picture, left, top, width, height, x, y, scale * width, scale * height);
      x += scale * width;
    }
  });
  return canvas;
}
