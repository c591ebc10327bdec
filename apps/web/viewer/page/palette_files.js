// Palette files: GIMP's .gpl, a hex list, Adobe Swatch Exchange .ase. Broken ones are refused.
// The same rules as in `toonset.palette.formats`, where the sources of the formats are named.

import { rgbOf } from "./colors.js";
import { LAB_WHITE, rgbFromLab } from "./lab.js";

const LARGEST_FILE = 1 << 20; // bytes
const ASE_COLOR = 1;
/** @type {Record<string, number>} colour model and how many numbers it has */
const ASE_MODELS = { RGB: 3, LAB: 3, CMYK: 4, Gray: 1 };

/** A file that is no palette; the message is for the reader. */
export class PaletteFileError extends Error {}

/**
 * @param {File} file
 * @returns {Promise<{colors: number[][], inks: boolean}>} sRGB, 0 to 255; whether from inks (CMYK)
 */
export async function readPaletteFile(file) {
  if (file.size > LARGEST_FILE) throw new PaletteFileError("is larger than a palette can be");
  const bytes = await file.arrayBuffer();
  const ending = file.name.toLowerCase().split(".").pop();
  const read = { gpl: readGpl, hex: readHexList, ase: readAse }[ending ?? ""];
  if (!read) throw new PaletteFileError("is no .gpl, .hex or .ase file");
  const found = read(bytes);
  if (!found.colors.length) throw new PaletteFileError("holds no colour");
  return found;
}

/** @param {ArrayBuffer} bytes @returns {string[]} */
function textLines(bytes) {
  const text = new TextDecoder().decode(bytes);
  if (text.includes("\0")) throw new PaletteFileError("is no text file");
  return text.split(/\r\n|\r|\n/);
}

/** @param {ArrayBuffer} bytes */
function readGpl(bytes) {
  const lines = textLines(bytes);
  if (!lines[0].startsWith("GIMP Palette")) throw new PaletteFileError('does not begin with "GIMP Palette"');
  const rgba = lines.some((line) => /^\s*Channels:\s*RGBA/i.test(line));
  const colors = [];
  for (const [i, line] of lines.entries()) {
    if (i === 0 || /^\s*(#|Name:|Columns:|Channels:|$)/i.test(line)) continue;
    const found = /^\s*(\d{1,3})\s+(\d{1,3})\s+(\d{1,3})(?:\s+(.*))?$/.exec(line);
    const rgb = found && found.slice(1, 4).map(Number);
    if (!rgb || rgb.some((v) => v > 255)) throw new PaletteFileError(`line ${i + 1} is no colour`);
    if (!(rgba && /^0(\s|$)/.test(found[4] ?? ""))) colors.push(rgb);
  }
  return { colors, inks: false };
}

/** @param {ArrayBuffer} bytes */
function readHexList(bytes) {
  const colors = [];
  for (const [i, line] of textLines(bytes).entries()) {
    const word = line.split(";")[0].trim();
    const rgb = rgbOf(word);
    if (rgb) colors.push(rgb);
    else if (word) throw new PaletteFileError(`line ${i + 1} is no colour like #d95430`);
  }
  return { colors, inks: false };
}

/** @param {ArrayBuffer} bytes */
function readAse(bytes) {
  const data = new DataView(bytes);
  if (bytes.byteLength < 12 || data.getUint32(0) !== 0x41534546) {
    throw new PaletteFileError("is no Adobe Swatch Exchange file");
  }
  const colors = [];
  let [at, inks] = [12, false];
  for (let block = data.getUint32(8); block > 0; block--) {
    const length = at + 6 <= bytes.byteLength ? data.getUint32(at + 2) : Infinity;
    if (at + 6 + length > bytes.byteLength) throw new PaletteFileError("is cut off");
    if (data.getUint16(at) === ASE_COLOR) {
      const { model, numbers } = aseColor(new DataView(bytes, at + 6, length));
      inks ||= model === "CMYK";
      colors.push(rgbOfModel(model, numbers));
    }
    at += 6 + length;
  }
  return { colors, inks };
}

/** @param {DataView} block @returns {{model: string, numbers: number[]}} */
function aseColor(block) {
  const start = block.byteLength < 2 ? Infinity : 2 + 2 * block.getUint16(0);
  if (start + 4 > block.byteLength) throw new PaletteFileError("is cut off in a colour");
  const letters = [0, 1, 2, 3].map((i) => String.fromCharCode(block.getUint8(start + i)));
  const model = letters.join("").trim();
  const count = Object.hasOwn(ASE_MODELS, model) ? ASE_MODELS[model] : 0;
  if (!count) throw new PaletteFileError("has a colour that is not RGB, CMYK, Gray or LAB");
  if (start + 4 + 4 * count > block.byteLength) throw new PaletteFileError("is cut off in a colour");
  const numbers = Array.from({ length: count }, (_, i) => block.getFloat32(start + 4 + 4 * i));
  if (!numbers.every((v, i) => inRange(model, i, v))) throw new PaletteFileError("has a colour out of range");
  return { model, numbers };
}

/** @param {string} model @param {number} i @param {number} value @returns {boolean} */
function inRange(model, i, value) {
  const [low, high] = model === "LAB" && i > 0 ? [-128, 128] : [0, 1];
  const slip = (high - low) * 1e-3;
  return value >= low - slip && value <= high + slip;
}

/** @param {string} model @param {number[]} numbers @returns {number[]} sRGB, 0 to 255 */
function rgbOfModel(model, numbers) {
  if (model === "LAB") return rgbFromLab(numbers[0] * LAB_WHITE, numbers[1], numbers[2]);
  const [c, m, y, k] = numbers;
  let parts = numbers;
  if (model === "Gray") parts = [c, c, c];
  if (model === "CMYK") parts = [c, m, y].map((ink) => (1 - ink) * (1 - k)); // no press is known
  return parts.map((v) => Math.round(255 * Math.min(1, Math.max(0, v))));
}
