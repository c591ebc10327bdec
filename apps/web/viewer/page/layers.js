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
  mannequin: "Body",
};

/**
 * @param {import("./types.js").Scene} scene
 * @param {import("./state.js").Store} store
 */
export function createLayers(scene, store) {
  const names = Object.fromEntries(scene.layers.map((layer) => [layer, LAYER_NAMES[layer]]));
  const lines = part("lines", HTMLButtonElement);
  const group = radioGroup("layer", names, (value) => store.set({ layer: /** @type {Layer} */ (value) }));
  part("layers", HTMLElement).append(...group.parts);
  lines.hidden = !scene.pen;
  lines.addEventListener("click", () => store.set({ lines: !store.state.lines }));

  /** @param {import("./state.js").State} state */
  function show(state) {
    group.show(state.layer);
    lines.setAttribute("aria-pressed", String(state.lines));
  }
  store.listen(show);
  show(store.state);
}
