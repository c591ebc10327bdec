// How far the mannequin's outline is from the drawing's, quick enough to be shown while it is dragged.

/** @typedef {import("./types.js").ViewRecord} ViewRecord */
/** @typedef {{width: number, height: number, inside: Uint8Array, edge: Uint8Array, far: Float32Array, px: number}} Mask */

const DIAGONAL = Math.SQRT2;

/**
 * @param {ViewRecord} view
 * @returns {Promise<Mask>} what its drawing covers
 */
export async function maskOf(view) {
  const image = await pictureOf(view.mask);
  const context = contextOf(image.width, image.height);
  context.drawImage(image, 0, 0);
  return measured(context, view.crop[2] / image.width);
}

/**
 * @param {Mask} mask
 * @param {ViewRecord} view
 * @param {Path2D} path what the mannequin covers, in pixels of the sheet
 * @returns {{iou: number, px: number}} intersection over union; mean distance of both outlines, pixels of the sheet
 */
export function outlineError(mask, view, path) {
  const context = contextOf(mask.width, mask.height);
  const [x, y, wide, high] = view.crop;
  context.fillRect(0, 0, mask.width, mask.height);
  context.setTransform(mask.width / wide, 0, 0, mask.height / high, 0, 0);
  context.translate(-x, -y);
  context.fillStyle = "white";
  context.fill(path);
  const body = measured(context, mask.px);
  let [both, any] = [0, 0];
  for (let i = 0; i < mask.inside.length; i++) {
    both += mask.inside[i] & body.inside[i];
    any += mask.inside[i] | body.inside[i];
  }
  const px = (meanAt(mask.far, body.edge) + meanAt(body.far, mask.edge)) / 2;
  return { iou: any ? both / any : 0, px: px * mask.px };
}

/** @param {string} url @returns {Promise<HTMLImageElement>} */
export async function pictureOf(url) {
  const image = new Image();
  image.src = url;
  await image.decode();
  return image;
}

/** @type {CanvasRenderingContext2D | null} */
let scratch = null;

/** @param {number} width @param {number} height @returns {CanvasRenderingContext2D} an empty one */
function contextOf(width, height) {
  scratch ??= document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  if (!scratch) throw new Error("this browser draws no pictures");
  [scratch.canvas.width, scratch.canvas.height] = [width, height]; // which empties it, too
  return scratch;
}

/** @param {CanvasRenderingContext2D} context @param {number} px of the sheet per pixel @returns {Mask} */
function measured(context, px) {
  const { width, height } = context.canvas;
  const { data } = context.getImageData(0, 0, width, height);
  const inside = new Uint8Array(width * height);
  for (let i = 0; i < inside.length; i++) inside[i] = data[4 * i] > 127 ? 1 : 0;
  const edge = edgeOf(inside, width, height);
  return { width, height, inside, edge, far: distances(edge, width, height), px };
}

/** @param {Uint8Array} inside @param {number} width @param {number} height @returns {Uint8Array} */
function edgeOf(inside, width, height) {
  const edge = new Uint8Array(inside.length);
  for (let y = 0, i = 0; y < height; y++) {
    for (let x = 0; x < width; x++, i++) {
      if (!inside[i]) continue;
      const within = x && y && x < width - 1 && y < height - 1;
      const full = within && inside[i - 1] && inside[i + 1] && inside[i - width] && inside[i + width];
      edge[i] = full ? 0 : 1;
    }
  }
  return edge;
}

/** @param {Uint8Array} edge @param {number} width @param {number} height @returns {Float32Array} to the nearest edge */
function distances(edge, width, height) {
  const far = Float32Array.from(edge, (one) => (one ? 0 : width + height));
  const relax = (/** @type {number} */ i, /** @type {number} */ j, /** @type {number} */ step) => {
    if (far[j] + step < far[i]) far[i] = far[j] + step;
  };
  const pass = (/** @type {number} */ x, /** @type {number} */ i, /** @type {number} */ way) => {
    const row = i - way * width;
    if (x > 0) relax(i, i - 1, 1);
    if (x < width - 1) relax(i, i + 1, 1);
    if (row < 0 || row >= far.length) return;
    relax(i, row, 1);
    if (x > 0) relax(i, row - 1, DIAGONAL);
    if (x < width - 1) relax(i, row + 1, DIAGONAL);
  };
  for (let i = 0; i < far.length; i++) pass(i % width, i, 1);
  for (let i = far.length - 1; i >= 0; i--) pass(i % width, i, -1);
  return far;
}

/** @param {Float32Array} far @param {Uint8Array} edge @returns {number} */
function meanAt(far, edge) {
  let [sum, count] = [0, 0];
  for (let i = 0; i < edge.length; i++) {
    if (!edge[i]) continue;
    sum += far[i];
    count++;
  }
  return count ? sum / count : 0;
}
