// Which layer of the rendering is shown.

import { part, radioGroup } from "./elements.js";

/** @typedef {import("./types.js").Layer} Layer */

/** @type {Record<Layer, string>} */
export const LAYER_NAMES = {
  drawn: "Drawn",
  rgb: "Colour",
  palette: "Palette",
  normal: "Normals",
  depth: "Depth",
  labels: "Labels",
  mannequin: "Body",
};

/**
 * @param {import("./types.js").Scene} scene
 * @param {import("./state.js").Store} store
 */
export function createLayers(scene, store) {
  const names = Object.fromEntries(scene.layers.map((layer) => [layer, LAYER_NAMES[layer]]));
  const group = radioGroup("layer", names, (value) => store.set({ layer: /** @type {Layer} */ (value) }));
  part("layers", HTMLElement).append(...group.parts);
  store.listen((state) => group.show(state.layer));
  group.show(store.state.layer);
}
