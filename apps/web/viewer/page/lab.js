// CIE L*a*b* (D50) to sRGB. Source: W3C, CSS Color Module Level 4, sections 9 to 11.

export const LAB_WHITE = 100;
const LAB_KAPPA = 24389 / 27;
const LAB_EPSILON = 216 / 24389;
const WHITE_D50 = [0.3457 / 0.3585, 1, (1 - 0.3457 - 0.3585) / 0.3585];
const D65_FROM_D50 = [
  [0.955473421488075, -0.02309845494876471, 0.06325924320057072],
  [-0.0283697093338637, 1.0099953980813041, 0.021041441191917323],
  [0.012314014864481998, -0.020507649298898964, 1.330365926242124],
];
const LINEAR_FROM_D65 = [
  [12831 / 3959, -329 / 214, -1974 / 3959],
  [-851781 / 878810, 1648619 / 878810, 36519 / 878810],
  [705 / 12673, -2585 / 12673, 705 / 667],
];

/**
 * @param {number} lightness 0 to 100
 * @param {number} a
 * @param {number} b
 * @returns {number[]} sRGB, 0 to 255; clipped
 */
export function rgbFromLab(lightness, a, b) {
  const y = (lightness + 16) / 116;
  const roots = [y + a / 500, y, y - b / 200];
  const xyz = roots.map(
    (root, i) => WHITE_D50[i] * (root ** 3 > LAB_EPSILON ? root ** 3 : (116 * root - 16) / LAB_KAPPA),
  );
  return matrixTimes(LINEAR_FROM_D65, matrixTimes(D65_FROM_D50, xyz)).map((linear) => {
    const v = Math.min(1, Math.max(0, linear));
    return Math.round(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055));
  });
}

/** @param {number[][]} matrix @param {number[]} vector @returns {number[]} */
function matrixTimes(matrix, vector) {
  return matrix.map((row) => row.reduce((sum, v, i) => sum + v * vector[i], 0));
}
