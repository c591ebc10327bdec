// Still PNG pictures to one animation.
// Source: W3C, "Portable Network Graphics (PNG) Specification (Third Edition)", 11.3.6.

const PNG_SIGNATURE = 8; // bytes
const APNG_RATE = 1000; // parts of a second that durations are counted in

/**
 * @param {ArrayBuffer[]} pictures PNG files of one size
 * @param {number} duration of each, milliseconds
 * @returns {Blob} that repeats for ever
 */
export function animatedPng(pictures, duration) {
  const [first] = pictures;
  let sequence = 0;
  const frames = pictures.flatMap((picture, i) => {
    const header = new DataView(pngChunks(picture, "IHDR")[0].slice().buffer);
    const control = new DataView(new ArrayBuffer(26));
    [sequence++, header.getUint32(0), header.getUint32(4), 0, 0].forEach((v, at) =>
      control.setUint32(4 * at, v),
    );
    control.setUint16(20, duration);
    control.setUint16(22, APNG_RATE);
    const data = pngChunks(picture, "IDAT").map((part) =>
      i ? pngChunk("fdAT", new Uint8Array([...uint32(sequence++), ...part])) : pngChunk("IDAT", part),
    );
    return [pngChunk("fcTL", new Uint8Array(control.buffer)), ...data];
  });
  return new Blob(
    [
      new Uint8Array(first, 0, PNG_SIGNATURE),
      pngChunk("IHDR", pngChunks(first, "IHDR")[0]),
      pngChunk("acTL", new Uint8Array([...uint32(pictures.length), ...uint32(0)])),
      ...frames,
      pngChunk("IEND", new Uint8Array()),
    ],
    { type: "image/png" },
  );
}

/**
 * @param {ArrayBuffer} file
 * @param {string} name
 * @returns {Uint8Array<ArrayBuffer>[]} the content of its chunks of that name
 */
function pngChunks(file, name) {
  const data = new DataView(file);
  const found = [];
  for (let at = PNG_SIGNATURE; at + 12 <= file.byteLength; at += 12 + data.getUint32(at)) {
    const letters = String.fromCharCode(...new Uint8Array(file, at + 4, 4));
    if (letters === name) found.push(new Uint8Array(file, at + 8, data.getUint32(at)));
  }
  return found;
}

/** @param {string} name @param {Uint8Array} content @returns {Uint8Array<ArrayBuffer>} */
function pngChunk(name, content) {
  const made = new Uint8Array(12 + content.length);
  made.set(uint32(content.length));
  made.set(
    [...name].map((letter) => letter.charCodeAt(0)),
    4,
  );
  made.set(content, 8);
  made.set(uint32(crc32(made.subarray(4, -4))), 8 + content.length);
  return made;
}

/** @param {Uint8Array} bytes @returns {number} CRC-32 */
function crc32(bytes) {
  let crc = 0xffffffff;
  for (const byte of bytes) {
    crc ^= byte;
    for (let bit = 0; bit < 8; bit++) crc = (crc >>> 1) ^ (crc & 1 ? 0xedb88320 : 0);
  }
  return ~crc >>> 0;
}

/** @param {number} value @returns {number[]} its bytes, the highest first */
function uint32(value) {
  return [value >>> 24, (value >> 16) & 255, (value >> 8) & 255, value & 255];
}
