// A drawing against the rendering from its camera: slider, beside, onion skin, difference.

import { part, radioGroup } from "./elements.js";
import { drawingBox } from "./framing.js";
import { COMPARISONS, clamp } from "./state.js";

/** @typedef {import("./state.js").State} State */
/** @typedef {import("./state.js").Comparison} Comparison */

const COMPARISON_NAMES = {
  slider: "Slider",
  beside: "Side by side",
  onion: "Onion skin",
  difference: "Difference",
};

/** @type {Record<string, number>} what keys add to the slider, percent */
const KEY_STEPS = {
  ArrowLeft: -2,
  ArrowDown: -2,
  ArrowRight: 2,
  ArrowUp: 2,
  PageDown: -10,
  PageUp: 10,
  Home: -100,
  End: 100,
};

/**
 * @param {import("./types.js").Scene} scene
 * @param {import("./state.js").Store} store
 * @param {(HTMLCanvasElement | null)[]} pictures of the drawings
 */
export function createCompare(scene, store, pictures) {
  const [stage, tools] = [part("stage", HTMLElement), part("compare", HTMLElement)];
  const overlay = part("overlay", HTMLCanvasElement);
  const [split, onion] = [part("split", HTMLElement), part("onion", HTMLInputElement)];
  const under = [part("view", HTMLElement), part("poster", HTMLElement)];
  const group = radioGroup("comparison", COMPARISON_NAMES, (value) =>
    store.set({ comparison: /** @type {Comparison} */ (value) }),
  );
  part("comparisons", HTMLElement).append(...group.parts);

  /** @param {State} state */
  function show(state) {
    const picture = pictures[state.snapped] ?? null;
    const { comparison } = state;
    const sliding = Boolean(picture) && comparison === "slider";
    tools.hidden = overlay.hidden = !picture;
    split.hidden = !sliding;
    stage.classList.toggle("difference", Boolean(picture) && comparison === "difference");
    part("onion_row", HTMLElement).hidden = comparison !== "onion";
    group.show(comparison);
    if (picture) drawOverlay(overlay, picture, state);
    overlay.style.opacity = comparison === "onion" ? String(state.onion) : "1";
    const left = state.split * 100;
    overlay.style.clipPath = sliding ? `inset(0 ${100 - left}% 0 0)` : "";
    for (const other of under) other.style.clipPath = sliding ? `inset(0 0 0 ${left}%)` : "";
    split.style.left = `${left}%`;
    split.setAttribute("aria-valuenow", left.toFixed(0));
    split.setAttribute("aria-valuetext", `${left.toFixed(0)} % drawing`);
    onion.value = (state.onion * 100).toFixed(0);
  }

  /** @param {number} share */
  const slide = (share) => store.set({ split: clamp(share, 0, 1) });

  split.addEventListener("keydown", (event) => {
    const step = KEY_STEPS[event.key];
    if (step === undefined) return;
    event.preventDefault();
    slide(Math.round(store.state.split * 100 + step) / 100);
  });
  split.addEventListener("pointerdown", (event) => split.setPointerCapture(event.pointerId));
  split.addEventListener("pointermove", (event) => {
    if (!split.hasPointerCapture(event.pointerId)) return;
    const box = stage.getBoundingClientRect();
    slide((event.clientX - box.left) / box.width);
  });
  onion.addEventListener("input", () => store.set({ onion: Number(onion.value) / 100 }));
  part("leave", HTMLElement).addEventListener("click", () => {
    store.set({ snapped: -1 });
    part("view", HTMLElement).focus();
  });
  /** @type {(keyof State)[]} */
  const watched = ["snapped", "comparison", "split", "onion", "size"];
  store.listen((state, old) => watched.some((name) => state[name] !== old[name]) && show(state));
  show(store.state);
}

/**
 * @param {HTMLCanvasElement} overlay
 * @param {HTMLCanvasElement} picture
 * @param {State} state
 */
function drawOverlay(overlay, picture, state) {
  [overlay.width, overlay.height] = state.size;
  const context = overlay.getContext("2d");
  if (!context) return;
  if (state.comparison === "difference") {
    context.fillStyle = "white"; // as behind the rendering then
    context.fillRect(0, 0, overlay.width, overlay.height);
  }
  const { x, y, factor } = drawingBox([picture.width, picture.height], state);
  context.imageSmoothingQuality = "high";
  context.drawImage(picture, x, y, picture.width * factor, picture.height * factor);
}

/**
 * @param {string | null} word
 * @returns {Comparison | null}
 */
export function comparisonOf(word) {
  return COMPARISONS.find((known) => known === word) ?? null;
}
