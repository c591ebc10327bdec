// Drawings that are shaded throughout in other colours: a paint's hue turns, its light and shade stay.
// The equation is that of palette/pixels/ramp_recolor.py. In OKLab all three of L, a and b are those of the
// new colour, L / own L times as large; so is linear light, the third power of that times as strong.

const MIXED_PAINTS = 16; // a flag of a pixel, see compose.js
const BESIDE = 5; // pixels: so far a paint's pure colours are looked for, and the deviation of their weights
const BESIDE_SIGMA = 2;
const DARKEST_PAINT = 0.02; // lightness: below, hue says nothing
// Source: B. Ottosson, "A perceptual color space for image processing" (2020)
const LMS_FROM_LINEAR = [0.4122214708, 0.5363325363, 0.0514459929, 0.2119034982, 0.6806995451, 0.1073969566, 0.0883024619, 0.2817188376, 0.6299787005];
const LIGHT_FROM_ROOTS = [0.2104542553, 0.793617785, -0.0040720468];
const LINEAR_OF_LEVEL = Float32Array.from({ length: 256 }, (_, level) => {
  const v = level / 255;
  return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
});

/**
 * @param {Uint8ClampedArray} color four bytes a pixel
 * @param {number} width
 * @param {Uint8Array} paints the first of every pixel
 * @param {Uint8Array} flags of every pixel
 * @param {{old: number[][], now: number[][]}} colors of the paints
 */
export function createTurn(color, width, paints, flags, { old, now }) {
  const moved = old.map((rgb, paint) => rgb.some((v, c) => v !== now[paint][c]));
  const own = old.map((rgb) => Math.max(DARKEST_PAINT, lightnessOf(rgb)));
  const targets = now.map((rgb) => {
    const lack = Math.max(0, DARKEST_PAINT ** 3 - lightnessOf(rgb) ** 3); // black, too, has light and shade
    return rgb.map((v) => LINEAR_OF_LEVEL[Math.round(v)] + lack);
  });
  const [pure, after] = [[0, 0, 0], [0, 0, 0]];

  /** Turn `pure`, a colour of a paint, into `after`. @param {number} paint */
  function turn(paint) {
    const gain = (lightnessOf(pure) / own[paint]) ** 3;
    for (let c = 0; c < 3; c++) {
      const v = Math.min(1, gain * targets[paint][c]);
      after[c] = 255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
    }
  }

  /** Find the colour that a paint has beside a pixel. @param {number} at @param {number} paint */
  function findPure(at, paint) {
    const [x, y] = [at % width, Math.floor(at / width)];
    let sum = 0;
    pure.fill(0);
    for (let v = Math.max(0, y - BESIDE); v <= y + BESIDE; v++) {
      for (let u = Math.max(0, x - BESIDE); u <= Math.min(width - 1, x + BESIDE); u++) {
        const i = v * width + u;
        if (!flags[i] || flags[i] & MIXED_PAINTS || paints[i] !== paint) continue; // none below the last row
        const weight = Math.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * BESIDE_SIGMA ** 2));
        sum += weight;
        for (let c = 0; c < 3; c++) pure[c] += weight * color[4 * i + c];
      }
    }
    for (let c = 0; c < 3; c++) pure[c] = sum ? pure[c] / sum : color[4 * at + c];
  }

  /**
   * @param {number} at the pixel
   * @param {number} first its paints
   * @param {number} second
   * @param {number} part of the second
   * @param {number[]} into its colour
   */
  return (at, first, second, part, into) => {
    for (let c = 0; c < 3; c++) into[c] = color[4 * at + c];
    for (const [paint, share] of [[first, 1 - part], [second, part]]) {
      if (!share || !moved[paint]) continue;
      if (share < 1) findPure(at, paint);
      else for (let c = 0; c < 3; c++) pure[c] = color[4 * at + c];
      turn(paint);
      for (let c = 0; c < 3; c++) into[c] += share * (after[c] - pure[c]);
    }
  };
}

/** @param {number[]} rgb 0 to 255 @returns {number} in OKLab */
function lightnessOf(rgb) {
  let light = 0;
  for (let root = 0; root < 3; root++) {
    let sum = 0;
    for (let c = 0; c < 3; c++) sum += LMS_FROM_LINEAR[3 * root + c] * LINEAR_OF_LEVEL[Math.round(rgb[c])];
    light += LIGHT_FROM_ROOTS[root] * Math.cbrt(sum);
  }
  return light;
}
