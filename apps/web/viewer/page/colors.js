// Colours as text.

/**
 * @param {number[]} rgb
 * @returns {string} "#rrggbb"
 */
export function hexOf(rgb) {
  return "#" + rgb.map((v) => Math.round(v).toString(16).padStart(2, "0")).join("");
}

/**
 * @param {string} text "#rrggbb" or "#rgb"; the # may be left out
 * @returns {number[] | null} null if it is none
 */
export function rgbOf(text) {
  const match = /^#?([0-9a-f]{3}|[0-9a-f]{6})$/i.exec(text);
  if (!match) return null;
  const digits = match[1].length === 3 ? match[1].replace(/./g, "$&$&") : match[1];
  return [0, 2, 4].map((at) => parseInt(digits.slice(at, at + 2), 16));
}
