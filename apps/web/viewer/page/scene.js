// The page's data: numbers as JSON, all else in one deflated blob.

/** @typedef {import("./types.js").Range} Range */

/** @returns {import("./types.js").Scene} */
export function readScene() {
  return JSON.parse(textOf("scene"));
}

/** @returns {Promise<Uint8Array>} the blob, inflated */
export async function readBlob() {
  const text = atob(textOf("blob"));
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = text.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/**
 * @param {Uint8Array} blob
 * @param {Range} range
 * @returns {Promise<ImageBitmap>} the WebP picture that lies there
 */
export function pictureAt(blob, [start, length]) {
  const file = new Blob([blob.slice(start, start + length)], { type: "image/webp" });
  return createImageBitmap(file);
}

/**
 * @param {number} width
 * @param {number} height
 * @param {(context: CanvasRenderingContext2D) => void} [paint]
 * @returns {HTMLCanvasElement} that has been painted
 */
export function newCanvas(width, height, paint = () => {}) {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [width, height];
  const context = canvas.getContext("2d");
  if (!context) throw new Error("the browser has no room for another picture");
  paint(context);
  return canvas;
}

/**
 * @param {string} id
 * @returns {string}
 */
function textOf(id) {
  return document.getElementById(id)?.textContent ?? "";
}
