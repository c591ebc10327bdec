// A compass under a drawing: from which side it shows the character, seen from above, front below.

import { element, svgElement } from "../../viewer/page/elements.js";
import { wrapped } from "../../viewer/page/state.js";

export const DIRECTIONS = /** @type {[string, number, string][]} label, yaw, in words */ ([
  ["front", 0, "front"],
  ["front-left", 45, "front left"],
  ["left", 90, "its left side"],
  ["back-left", 135, "back left"],
  ["back", 180, "back"],
  ["back-right", -135, "back right"],
  ["right", -90, "its right side"],
  ["front-right", -45, "front right"],
]);
const SIDE = 120; // pixels
const RING = 44;

/**
 * @param {number} number of the drawing
 * @param {(label: string) => void} choose
 */
export function createCompass(number, choose) {
  const svg = svgElement("svg", { viewBox: `0 0 ${SIDE} ${SIDE}`, "aria-hidden": "true" });
  const spread = svgElement("path", { class: "spread" });
  const needle = svgElement("path", { class: "needle" });
  for (const [word, y] of /** @type {[string, string][]} */ ([["back", "14"], ["front", "114"]])) {
    const text = svgElement("text", { x: "75", y });
    text.textContent = word;
    svg.append(text);
  }
  svg.append(svgElement("circle", { cx: "60", cy: "60", r: String(RING), class: "ring" }), spread, needle);
  const inputs = DIRECTIONS.map(([label, yaw, word]) => {
    const input = element("input", { type: "radio", name: `direction${number}`, value: label, "aria-label": word, title: word });
    const [x, y] = placeOf(yaw, RING);
    [input.style.left, input.style.top] = [`${(100 * x) / SIDE}%`, `${(100 * y) / SIDE}%`];
    input.addEventListener("change", () => choose(label));
    return input;
  });
  const group = element("div", { class: "compass", role: "radiogroup", "aria-label": `Direction of drawing ${number}` });
  group.append(svg, ...inputs);
  return {
    part: group,
    /** @param {number | null} yaw as fitted, degrees @param {number} sigma degrees @param {string | undefined} label as said */
    show(yaw, sigma, label) {
      inputs.forEach((input) => (input.checked = input.value === label));
      needle.setAttribute("d", yaw === null ? "" : `M60 60L${placeOf(yaw, RING - 8).join(" ")}`);
      spread.setAttribute("d", yaw === null ? "" : wedge(yaw, Math.min(sigma, 90)));
    },
  };
}

/** @param {string | undefined} label @returns {number | null} the yaw of a word or a number, degrees */
export function yawOfLabel(label) {
  const known = DIRECTIONS.find(([word]) => word === label);
  if (known) return known[1];
  const number = Number(label || NaN);
  return Number.isFinite(number) ? wrapped(number) : null;
}

/** @param {number} yaw @param {number} far @returns {number[]} in the picture */
function placeOf(yaw, far) {
  const turn = (yaw * Math.PI) / 180;
  return [SIDE / 2 + far * Math.sin(turn), SIDE / 2 + far * Math.cos(turn)];
}

/** @param {number} yaw @param {number} sigma @returns {string} */
function wedge(yaw, sigma) {
  const [[x, y], [u, v]] = [placeOf(yaw - sigma, RING), placeOf(yaw + sigma, RING)];
  return `M60 60L${x} ${y}A${RING} ${RING} 0 0 0 ${u} ${v}Z`;
}
