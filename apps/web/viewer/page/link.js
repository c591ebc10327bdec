// The page's address holds what it shows; anything else in there is passed over.

import { hexOf, rgbOf } from "./colors.js";
import { comparisonOf } from "./compare.js";
import { copyText, part } from "./elements.js";
import { limited } from "./framing.js";
import { sameColor, startState, wrapped } from "./state.js";

/** @typedef {import("./types.js").Scene} Scene */
/** @typedef {import("./state.js").State} State */

const CALM = 250; // milliseconds after the last change

/**
 * @param {Scene} scene
 * @param {State} state
 * @returns {string} without "#"; empty at the start
 */
export function hashOf(scene, state) {
  const start = startState(scene);
  const short = (/** @type {number} */ v, digits = 2) => String(Number(v.toFixed(digits)));
  const colors = state.colors.map((rgb) => hexOf(rgb).slice(1)).join(",");
  /** @type {[string, string, boolean][]} name, value, whether it differs from the start */
  const entries = [
    ["yaw", short(wrapped(state.yaw)), short(state.yaw) !== short(start.yaw)],
    ["elevation", short(state.elevation), short(state.elevation) !== short(start.elevation)],
    ["zoom", short(state.zoom, 3), state.zoom !== 1],
    ["pan", state.pan.map((v) => short(v, 3)).join(","), state.pan.some((v) => v !== 0)],
    ["layer", state.layer, state.layer !== start.layer],
    ["colors", colors, state.colors.some((rgb, i) => !sameColor(rgb, start.colors[i]))],
    ["ink", state.ink ? hexOf(state.ink).slice(1) : "", !sameColor(state.ink, start.ink)],
    ["lines", "0", !state.lines],
    ["view", String(state.snapped + 1), state.snapped >= 0],
    ["compare", state.comparison, state.snapped >= 0 && state.comparison !== start.comparison],
    ["cameras", "1", state.cameras],
    ["notdrawn", "1", state.origins],
  ];
  const kept = entries.filter(([, , differs]) => differs);
  return kept.map(([name, value]) => `${name}=${value}`).join("&");
}

/**
 * @param {Scene} scene
 * @param {string} hash with or without "#"
 * @returns {Partial<State>} all that a link says; what it leaves out or garbles is as at the start
 */
export function stateOfHash(scene, hash) {
  const { size, split, onion, ...start } = startState(scene);
  const words = new URLSearchParams(hash.replace(/^#/, ""));
  const pan = (words.get("pan") ?? "").split(",").map((word) => numberOf(word, NaN));
  const view = numberOf(words.get("view"), 0);
  const colors = (words.get("colors") ?? "").split(",").map(rgbOf);
  return {
    ...start,
    ...limited(scene, {
      yaw: wrapped(numberOf(words.get("yaw"), start.yaw)),
      elevation: numberOf(words.get("elevation"), start.elevation),
      zoom: numberOf(words.get("zoom"), 1),
      pan: pan.length === 2 && pan.every(Number.isFinite) ? pan : start.pan,
    }),
    layer: scene.layers.find((layer) => layer === words.get("layer")) ?? start.layer,
    colors: colors.length === start.colors.length && colors.every(isColor) ? colors : start.colors,
    ink: start.ink && (rgbOf(words.get("ink") ?? "") ?? start.ink),
    lines: words.get("lines") !== "0",
    snapped: scene.views[view - 1] ? view - 1 : -1,
    comparison: comparisonOf(words.get("compare")) ?? start.comparison,
    cameras: words.get("cameras") === "1",
    origins: words.get("notdrawn") === "1",
  };
}

/**
 * @param {Scene} scene
 * @param {import("./state.js").Store} store
 * @param {() => void} whenRead the state came from a link
 * @returns {boolean} whether it did at once
 */
export function createLink(scene, store, whenRead) {
  let timer = 0;

  function write() {
    clearTimeout(timer);
    const embedded = document.body.classList.contains("embedded") ? "embed=1" : "";
    const hash = [embedded, hashOf(scene, store.state)].filter(Boolean).join("&");
    const address = location.href.split("#")[0];
    try {
      if (hash !== location.hash.slice(1))
        history.replaceState(null, "", hash ? `${address}#${hash}` : address);
    } catch {
      // some places where pages are embedded have no history
    }
  }

  function read() {
    store.set(stateOfHash(scene, location.hash));
    document.body.classList.toggle("embedded", new URLSearchParams(location.hash.slice(1)).get("embed") === "1");
    whenRead();
  }

  addEventListener("hashchange", read);
  part("copy_link", HTMLElement).addEventListener("click", () => {
    write();
    copyText(`${location.href.split("#")[0]}#${hashOf(scene, store.state)}`, "The link is copied.");
  });
  part("copy_embed", HTMLElement).addEventListener("click", () => {
    const { snapped, yaw } = store.state; // a drawing beside the figure is no part of it
    const shown = snapped < 0 ? yaw : scene.views[snapped].yaw;
    const state = hashOf(scene, { ...store.state, snapped: -1, yaw: shown });
    copyText(embedCode(scene.title, `embed=1${state && "&"}${state}`), "The embed code is copied.");
  });
  if (location.hash) read();
  store.listen(() => {
    clearTimeout(timer);
    timer = setTimeout(write, CALM);
  });
  return [...new URLSearchParams(location.hash.slice(1)).keys()].some((name) => name !== "embed");
}

/**
 * @param {string} title
 * @param {string} hash
 * @returns {string} HTML that shows the figure on another page; a file is looked for beside that
 */
export function embedCode(title, hash) {
  const page = location.href.split("#")[0];
  const source = location.protocol === "file:" ? page.slice(page.lastIndexOf("/") + 1) : page;
  const frame = document.createElement("iframe");
  frame.setAttribute("src", `${source}#${hash}`);
  frame.setAttribute("title", title);
  frame.setAttribute("width", "480");
  frame.setAttribute("height", "600");
  frame.setAttribute("frameborder", "0"); // the page's policy allows no style attribute
  frame.setAttribute("allow", "fullscreen");
  return frame.outerHTML;
}

/** @param {number[] | null} rgb @returns {rgb is number[]} */
function isColor(rgb) {
  return rgb !== null;
}

/** @param {string | null} word @param {number} otherwise @returns {number} */
function numberOf(word, otherwise) {
  return word && /^-?\d{1,6}(\.\d{1,9})?$/.test(word) ? Number(word) : otherwise;
}
