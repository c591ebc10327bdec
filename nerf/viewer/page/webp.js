// Still WebP pictures to one animation: a RIFF file of VP8X, ANIM and a frame (ANMF) each.
// Source: Google, "WebP Container Specification".

const HAS_ALPHA = 0x10;
const IS_ANIMATED = 0x02;
const NO_BLENDING = 0x02; // a frame replaces the one before it
const PICTURE_CHUNKS = ["ALPH", "VP8 ", "VP8L"];

/**
 * @param {ArrayBuffer[]} pictures WebP files of one size
 * @param {number} width
 * @param {number} height
 * @param {number} duration of each, milliseconds
 * @returns {Blob} that repeats for ever
 */
export function animatedWebp(pictures, width, height, duration) {
  const size = [...uint24(width - 1), ...uint24(height - 1)];
  const frames = pictures.map((picture) => {
    const head = [...uint24(0), ...uint24(0), ...size, ...uint24(duration), NO_BLENDING];
    return riffChunk("ANMF", [new Uint8Array(head), ...pictureChunks(picture)]);
  });
  const head = riffChunk("VP8X", [new Uint8Array([HAS_ALPHA | IS_ANIMATED, 0, 0, 0, ...size])]);
  const parts = [riffLetters("WEBP"), ...head, ...riffChunk("ANIM", [new Uint8Array(6)]), ...frames.flat()];
  return new Blob(riffChunk("RIFF", parts), { type: "image/webp" });
}

/** @param {ArrayBuffer} file @returns {Uint8Array<ArrayBuffer>[]} its chunks that hold pixels, padded */
function pictureChunks(file) {
  const data = new DataView(file);
  const found = [];
  for (let at = 12; at + 8 <= file.byteLength;) {
    const name = String.fromCharCode(...new Uint8Array(file, at, 4));
    const length = data.getUint32(at + 4, true);
    const padded = Math.min(8 + length + (length % 2), file.byteLength - at);
    if (PICTURE_CHUNKS.includes(name)) found.push(new Uint8Array(file, at, padded));
    at += 8 + length + (length % 2);
  }
  return found;
}

/**
 * @param {string} name
 * @param {Uint8Array<ArrayBuffer>[]} parts
 * @returns {Uint8Array<ArrayBuffer>[]}
 */
function riffChunk(name, parts) {
  const length = parts.reduce((sum, bytes) => sum + bytes.length, 0);
  const size = new Uint8Array([length & 255, (length >> 8) & 255, (length >> 16) & 255, length >>> 24]);
  return [riffLetters(name), size, ...parts, new Uint8Array(length % 2)];
}

/** @param {string} text @returns {Uint8Array<ArrayBuffer>} */
function riffLetters(text) {
  return Uint8Array.from(text, (letter) => letter.charCodeAt(0));
}

/** @param {number} value @returns {number[]} */
function uint24(value) {
  return [value & 255, (value >> 8) & 255, (value >> 16) & 255];
}
