// What no drawing shows: how much of a view is a mirror image or a guess, in words.

import { part } from "./elements.js";
import { shownSight } from "./framing.js";

/** @typedef {import("./types.js").Scene} Scene */

/**
 * @param {Scene} scene
 * @param {import("./state.js").Store} store
 * @param {(sight: number) => number[]} sharesOf how much of a view is mirrored, and guessed
 */
export function createOrigins(scene, store, sharesOf) {
  const [button, words] = [part("origins", HTMLButtonElement), part("origin_words", HTMLElement)];
  button.hidden = !scene.sights.some(({ layers }) => Object.values(layers).some((record) => record?.origins));
  button.addEventListener("click", () => store.set({ origins: !store.state.origins }));

  /** @param {import("./state.js").State} state */
  function show(state) {
    button.setAttribute("aria-pressed", String(state.origins));
    words.hidden = !state.origins || button.hidden;
    if (!state.origins) return;
    if (state.layer !== scene.layers[0]) words.textContent = "Choose the first layer to see what is not drawn.";
    else words.textContent = originWords(sharesOf(shownSight(scene, state)));
  }
  store.listen(show);
  show(store.state);
}

/** @param {number[]} shares mirrored and guessed @returns {string} */
function originWords([mirrored, guessed]) {
  const percent = (/** @type {number} */ share) => (share > 0 && share < 0.005 ? "< 1 %" : `${(100 * share).toFixed(0)} %`);
  return `Of this view ${percent(mirrored)} is the mirror image of a drawing (blue), ${percent(guessed)} is a guess (red).`;
}
