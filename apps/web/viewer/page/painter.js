// Shows views of the figure: each is a picture, or layers that are put together in today's colours.

import { project } from "./camera.js";
import { composed } from "./compose.js";
import { newCanvas, pictureAt } from "./scene.js";

/** @typedef {import("./types.js").LayerRecord} LayerRecord */
/** @typedef {import("./types.js").Scene} Scene */
/** @typedef {import("./types.js").Shot} Shot */
/** @typedef {{picture?: ImageBitmap, light?: Uint8ClampedArray | null}} Loaded what a record's files hold */

const ORIGIN_COLORS = [[0, 0, 0], [20, 90, 220], [220, 30, 30]]; // drawn, mirrored, guessed
const HATCH = 6; // pixels of the map of origins from stripe to stripe

/**
 * @param {HTMLCanvasElement} canvas
 * @param {Scene} scene
 * @param {Uint8Array} blob
 * @param {() => void} ask for the picture again: what it lacked is there
 */
export function createPainter(canvas, scene, blob, ask) {
  /** @type {Map<LayerRecord, Promise<Loaded>>} */
  const loading = new Map();
  /** @type {Map<LayerRecord, Loaded>} */
  const loaded = new Map();
  /** @type {Map<LayerRecord, HTMLCanvasElement>} in the colours of `shown` */
  const made = new Map();
  let shown = "";

  /** @param {LayerRecord} record @returns {Promise<Loaded>} */
  function load(record) {
    const known = loading.get(record) ?? read(record);
    loading.set(record, known);
    return known;
  }

  /** @param {LayerRecord} record @returns {Promise<Loaded>} */
  async function read(record) {
    /** @type {Loaded} */
    const found = record.picture
      ? { picture: await pictureAt(blob, record.picture) }
      : { light: await pixelsAt(record.color ?? record.light) };
    loaded.set(record, found);
    return found;
  }

  /** @param {import("./types.js").Range | null} range @returns {Promise<Uint8ClampedArray | null>} */
  const pixelsAt = async (range) => range && pixelsOf(await pictureAt(blob, range));

  /** @param {LayerRecord} record @param {Loaded} files @param {Shot} shot @returns {CanvasImageSource} */
  function pictureOf(record, files, { colors, pen, lines }) {
    if (files.picture) return files.picture;
    const key = JSON.stringify([colors, pen, lines]);
    if (key !== shown) made.clear();
    shown = key;
    const known = made.get(record);
    if (known) return known;
    const [start, length] = record.maps;
    const others = scene.paints.slice(colors.length);
    const old = [...scene.palette.map((paint) => paint.rgb), ...others];
    const now = [...colors, ...(pen ? [...others.slice(0, -1), pen] : others)];
    const maps = blob.subarray(start, start + length);
    const ink = lines ? pen : null;
    const pixels = composed(record, maps, files.light ?? null, { old, now, ink }, scene.coding);
    const picture = newCanvas(pixels.width, pixels.height, (context) => context.putImageData(pixels, 0, 0));
    made.set(record, picture);
    return picture;
  }

  /** @param {HTMLCanvasElement} into @param {Shot} shot @param {LayerRecord | null} record @param {Loaded} files */
  function put(into, shot, record, files) {
    const { camera } = shot;
    if (into.width !== camera.size[0]) into.width = camera.size[0];
    if (into.height !== camera.size[1]) into.height = camera.size[1];
    const context = into.getContext("2d");
    context?.clearRect(0, 0, into.width, into.height);
    if (!context || !record) return;
    const { target, size, fill, reach } = scene.figure;
    const [u, v, depth] = project(camera, target);
    const factor = (2 * reach * camera.scale) / (fill * size * (1 + camera.k * depth));
    const [left, top, width, height] = record.box;
    context.imageSmoothingQuality = "high";
    /** @type {[number, number, number, number]} */
    const place = [
      u + (left - size / 2) * factor,
      v + (top - size / 2) * factor * camera.aspect,
      width * factor,
      height * factor * camera.aspect,
    ];
    context.drawImage(pictureOf(record, files, shot), ...place);
    if (shot.origins && record.origins) context.drawImage(hatched(record.origins), ...place);
  }

  /** @param {{size: number[], map: import("./types.js").Range}} origins @returns {HTMLCanvasElement} */
  function hatched({ size: [width, height], map: [start, length] }) {
    const map = blob.subarray(start, start + length);
    const pixels = new ImageData(width, height);
    map.forEach((origin, i) => {
      const bright = ((i % width) + Math.floor(i / width)) % HATCH < HATCH / 2;
      if (origin) pixels.data.set([...ORIGIN_COLORS[origin], bright ? 170 : 60], 4 * i);
    });
    return newCanvas(width, height, (context) => context.putImageData(pixels, 0, 0));
  }

  /** @param {Shot} shot */
  const recordOf = (shot) => scene.sights[shot.sight].layers[shot.layer] ?? null;

  return {
    /**
     * Show a view on the canvas, which takes its size; what is not read yet is shown a moment later.
     * @param {Shot} shot
     * @returns {boolean} whether it is shown
     */
    draw(shot) {
      const record = recordOf(shot);
      const files = record ? loaded.get(record) : {};
      if (files) put(canvas, shot, record, files);
      else if (record) load(record).then(ask, ask);
      return Boolean(files);
    },

    /**
     * @param {Shot} shot
     * @returns {Promise<HTMLCanvasElement>} a picture of its own
     */
    async read(shot) {
      const record = recordOf(shot);
      const files = record ? await load(record) : {};
      return newCanvas(1, 1, ({ canvas: own }) => put(own, shot, record, files));
    },

    /** @param {number} sight @returns {number[]} shares of a view that are mirrored, and guessed */
    originsOf(sight) {
      const { mirrored, guessed } = scene.sights[sight].layers[scene.layers[0]]?.origins ?? { mirrored: 0, guessed: 0 };
      return [mirrored, guessed];
    },

    /** Read what turning needs, one view after the other. */
    async readAll() {
      for (const { layers } of scene.sights) {
        const record = layers[scene.layers[0]];
        if (record) await load(record).catch(() => {});
      }
    },
  };
}

/** @param {ImageBitmap} picture @returns {Uint8ClampedArray} four bytes a pixel */
function pixelsOf(picture) {
  const { width, height } = picture;
  const canvas = newCanvas(width, height, (context) => context.drawImage(picture, 0, 0));
  return /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d")).getImageData(0, 0, width, height).data;
}
