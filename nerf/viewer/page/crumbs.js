// Small parts and holes of a silhouette are noise: which pixels belong to them.

const KEEP = 0; // of a pixel: as it is
export const DROP = 128; // outside of the figure
export const FILL = 255; // inside
const AROUND = 2; // pixels: a hole's soft border goes with it

/**
 * @param {Uint8ClampedArray} mask four bytes a pixel, the first 255 inside of the figure
 * @param {number} width
 * @param {number} height
 * @param {number} crumb area: smaller parts are dropped
 * @param {number} hole area: smaller holes are filled
 * @returns {Uint8Array | null} a byte per pixel; null: nothing changes
 */
export function crumbsOf(mask, width, height, crumb, hole) {
  const count = width * height;
  const seen = new Uint8Array(count);
  const queue = new Int32Array(count);
  const change = new Uint8Array(count).fill(KEEP);
  let any = false;
  for (let start = 0; start < count; start++) {
    if (seen[start]) continue;
    const inside = mask[4 * start] > 127;
    let [head, tail] = [0, 1];
    queue[0] = start;
    seen[start] = 1;
    const visit = (/** @type {number} */ next) => {
      if (seen[next] || mask[4 * next] > 127 !== inside) return;
      seen[next] = 1;
      queue[tail++] = next;
    };
    while (head < tail) {
      const at = queue[head++];
      const x = at % width;
      if (x > 0) visit(at - 1);
      if (x < width - 1) visit(at + 1);
      if (at >= width) visit(at - width);
      if (at < count - width) visit(at + width);
    }
    if (tail >= (inside ? crumb : hole)) continue;
    any = true;
    for (let i = 0; i < tail; i++) spread(change, queue[i], width, height, inside ? DROP : FILL);
  }
  return any ? change : null;
}

/**
 * @param {Uint8Array} change
 * @param {number} at
 * @param {number} width
 * @param {number} height
 * @param {number} value
 */
function spread(change, at, width, height, value) {
  const [x, y] = [at % width, Math.floor(at / width)];
  for (let v = Math.max(0, y - AROUND); v <= Math.min(height - 1, y + AROUND); v++) {
    change.fill(value, v * width + Math.max(0, x - AROUND), v * width + Math.min(width, x + AROUND + 1));
  }
}
