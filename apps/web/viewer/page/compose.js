// One view of the drawn look in any colours, of the layers that nerf/layered_views/layered.py made of it.

import { createTurn } from "./ramps.js";

/** @typedef {import("./types.js").LayeredRecord} LayeredRecord */
/** @typedef {import("./types.js").Coding} Coding */

/**
 * @typedef {object} Colors sRGB, 0 to 255
 * @property {number[][]} old of the paints, as the layers were made
 * @property {number[][]} now as they are shown
 * @property {number[] | null} ink of the lines; null: without lines
 */

const [SOFT, INKED, LINED, MIXED, STAYS] = [2, 4, 8, 16, 32]; // flags of a pixel; 1: opaque
const LUMA = [0.299, 0.587, 0.114]; // Source: ITU-R BT.601

/**
 * @param {LayeredRecord} record
 * @param {Uint8Array} maps of it, see `layered_record` in nerf/layered_views/records.py
 * @param {Uint8ClampedArray | null} files pixels: the colours, or how they differ from their paints
 * @param {Colors} colors
 * @param {Coding} coding
 * @returns {ImageData} straight alpha
 */
export function composed({ size: [width, height], color }, maps, files, colors, coding) {
  const { levels, parts, middle, darkest, lightest, brightest, tint } = coding;
  const most = middle + (brightest - 1) * (middle - darkest); // the level of the largest gain
  const count = width * height;
  const flags = maps.subarray(count, 2 * count);
  const many = [SOFT, LINED, MIXED].map((flag) => flags.reduce((n, f) => n + (f & flag ? 1 : 0), 0));
  let at = 2 * count;
  let [alphaAt, inkAt, secondAt, partAt] = [0, ...many].map((n) => (at += n));
  const [old, now] = [colors.old, colors.now].map((table) => Float32Array.from(table.flat()));
  const picture = new ImageData(width, height);
  const { data } = picture;
  const off = [0, 0, 0]; // of the tint
  const light = color ? null : files;
  const turn = color && files ? createTurn(files, width, maps, flags, colors) : null;
  const turned = [0, 0, 0];
  for (let i = 0; i < count; i++) {
    const flag = flags[i];
    if (!flag) continue;
    const a = 3 * maps[i];
    const alpha = flag & SOFT ? maps[alphaAt++] / levels : 1;
    const covered = flag & INKED ? 1 : flag & LINED ? maps[inkAt++] / levels : 0;
    const b = flag & MIXED ? 3 * maps[secondAt++] : a;
    const part = flag & MIXED ? maps[partAt++] / parts : 0;
    let [gain, glow] = [1, 0];
    off.fill(0);
    if (light && !(flag & INKED)) {
      const [red, green, blue] = [light[4 * i], light[4 * i + 1], light[4 * i + 2]];
      const level = LUMA[0] * red + LUMA[1] * green + LUMA[2] * blue;
      gain = Math.max(0, Math.min(brightest, 1 + (level - middle) / (middle - darkest)));
      glow = Math.max(0, Math.min(1, (level - most) / (lightest - most)));
      off[0] = tint * (red - level);
      off[1] = tint * (green - level);
      off[2] = tint * (blue - level);
    }
    turn?.(i, maps[i], b / 3, part, turned);
    for (let c = 0; c < 3; c++) {
      const before = old[a + c] + part * (old[b + c] - old[a + c]);
      const after = now[a + c] + part * (now[b + c] - now[a + c]);
      let value = flag & STAYS ? before : after;
      value = Math.min(1, gain) * value + Math.max(0, gain - 1) * before; // as much brighter as it was
      value += glow * (255 - value) + off[c];
      if (turn) value = turned[c];
      value = Math.min(255, Math.max(0, value));
      if (colors.ink) value += covered * (colors.ink[c] - value);
      data[4 * i + c] = value;
    }
    data[4 * i + 3] = 255 * alpha;
  }
  return picture;
}
