// One view of the drawn look in any colours, of the layers that nerf/viewer/layered.py made of it.

/** @typedef {import("./types.js").LayeredRecord} LayeredRecord */

/**
 * @typedef {object} Colors sRGB, 0 to 255
 * @property {number[][]} old of the paints, as the layers were made
 * @property {number[][]} now as they are shown
 * @property {number[] | null} ink of the lines; null: without lines
 */

const [SOFT, INKED, LINED, MIXED, MOVED] = [2, 4, 8, 16, 32]; // flags of a pixel; 1: opaque

/**
 * @param {LayeredRecord} record
 * @param {Uint8Array} maps of it, see `layered_record` in nerf/viewer/scene.py
 * @param {Uint8ClampedArray | null} rest pixels of what the paints do not explain
 * @param {Colors} colors
 * @param {import("./types.js").Coding} coding
 * @returns {ImageData} straight alpha
 */
export function composed({ size: [width, height] }, maps, rest, colors, coding) {
  const { levels, parts, moves, step, middle } = coding;
  const count = width * height;
  const flags = maps.subarray(count, 2 * count);
  const many = [SOFT, LINED, MIXED, MIXED].map((flag) => flags.reduce((n, f) => n + (f & flag ? 1 : 0), 0));
  let at = 2 * count;
  let [alphaAt, inkAt, secondAt, partAt, movedAt] = [0, ...many].map((n) => (at += n));
  const [old, now] = [colors.old, colors.now].map((table) => Float32Array.from(table.flat()));
  const picture = new ImageData(width, height);
  const { data } = picture;
  for (let i = 0; i < count; i++) {
    const flag = flags[i];
    if (!flag) continue;
    const a = 3 * maps[i];
    const alpha = flag & SOFT ? maps[alphaAt++] / levels : 1;
    const covered = flag & INKED ? 1 : flag & LINED ? maps[inkAt++] / levels : 0;
    const b = flag & MIXED ? 3 * maps[secondAt++] : a;
    const part = flag & MIXED ? maps[partAt++] / parts : 0;
    const moved = flag & MOVED ? moves[maps[movedAt++]] : 1;
    for (let c = 0; c < 3; c++) {
      const before = old[a + c] + part * (old[b + c] - old[a + c]);
      const after = now[a + c] + part * (now[b + c] - now[a + c]);
      let value = before + moved * (after - before);
      if (rest) value += step * (rest[4 * i + c] - middle);
      value = Math.min(255, Math.max(0, value));
      if (colors.ink) value += covered * (colors.ink[c] - value);
      data[4 * i + c] = value;
    }
    data[4 * i + 3] = 255 * alpha;
  }
  return picture;
}
