// The page's data: numbers as JSON, arrays in one deflated blob.

/** @typedef {import("./types.js").ArrayRecord} ArrayRecord */

const TYPES = { uint8: Uint8Array, uint32: Uint32Array, float16: Uint16Array, float32: Float32Array };

/** @returns {import("./types.js").Scene} */
export function readScene() {
  return JSON.parse(textOf("scene"));
}

/** @returns {string[]} pictures of a whole turn, the front first, as data URLs */
export function readTurn() {
  return JSON.parse(textOf("turn"));
}

/** @returns {Promise<ArrayBuffer>} the arrays, inflated */
export async function readBlob() {
  const text = atob(textOf("blob"));
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

/**
 * @param {ArrayBuffer} blob
 * @param {ArrayRecord} record
 * @returns {Uint8Array | Uint16Array | Uint32Array | Float32Array} half floats as their 16 bits
 */
export function arrayOf(blob, record) {
  const Type = TYPES[/** @type {keyof TYPES} */ (record.type)];
  return new Type(blob, record.at, record.shape.reduce((a, b) => a * b, 1));
}

/**
 * @param {string} id
 * @returns {string}
 */
function textOf(id) {
  return document.getElementById(id)?.textContent ?? "";
}
