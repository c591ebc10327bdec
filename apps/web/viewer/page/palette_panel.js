// The paints: recolour each, undo and redo, take the colours of a file.

import { hexOf, rgbOf } from "./colors.js";
import { copyText, element, part, say } from "./elements.js";
import { PaletteFileError, readPaletteFile } from "./palette_files.js";
import { sameColor, startState } from "./state.js";

/** @typedef {import("./types.js").Scene} Scene */
/** @typedef {import("./state.js").State} State */
/** @typedef {Pick<State, "colors" | "ink">} Coloring */

/**
 * @param {Scene} scene
 * @param {import("./state.js").Store} store
 */
export function createPalettePanel(scene, store) {
  const rows = scene.palette.map((paint) => swatchRow(paint.name, shareWords(paint.share)));
  const inkRow = scene.pen ? swatchRow("Lines", "") : null;
  const strip = scene.palette.map((paint) => stripe(paint.share));
  const undo = createUndo(store);

  /** @param {State} state */
  function show({ colors, ink }) {
    rows.forEach((row, i) => row.show(colors[i], !sameColor(colors[i], scene.palette[i].rgb)));
    strip.forEach((stripe, i) => (stripe.style.backgroundColor = hexOf(colors[i])));
    if (ink) inkRow?.show(ink, false);
  }

  rows.forEach((row, i) =>
    row.onColor(
      (rgb) => store.set({ colors: store.state.colors.map((old, j) => (i === j ? rgb : old)) }),
      undo.keep,
    ),
  );
  inkRow?.onColor((ink) => store.set({ ink }), undo.keep);
  part("swatches", HTMLElement).append(...[...rows, ...(inkRow ? [inkRow] : [])].map((row) => row.item));
  part("strip", HTMLElement).append(...strip);
  part("paints", HTMLElement).hidden = !rows.length && !inkRow;
  part("reset", HTMLElement).addEventListener("click", () => {
    const { colors, ink } = startState(scene);
    store.set({ colors, ink });
    undo.keep();
  });
  part("copy_hex", HTMLElement).addEventListener("click", () =>
    copyText(store.state.colors.map((rgb) => `${hexOf(rgb)}\n`).join(""), "The hex list is copied."),
  );
  takeFiles(async (file) => {
    const name = file.name.length > 60 ? `${file.name.slice(0, 60)}…` : file.name;
    try {
      const { colors, inks } = await readPaletteFile(file);
      store.set({ colors: store.state.colors.map((old, i) => colors[i] ?? old) });
      undo.keep();
      say(
        `${name}: ${countWords(colors.length, rows.length)}${inks ? " CMYK colours are approximate." : ""}`,
      );
    } catch (error) {
      if (!(error instanceof PaletteFileError)) throw error;
      say(`${name}: ${error.message}.`);
    }
  });
  store.listen((state, old) => {
    if (state.colors !== old.colors || state.ink !== old.ink) show(state);
  });
  show(store.state);
  return { forget: undo.forget };
}

/**
 * @param {string} name
 * @param {string} share
 */
function swatchRow(name, share) {
  const input = element("input", { type: "color" });
  const code = element("code");
  const word = element("bdi", { class: "name" }, name);
  const label = element(
    "label",
    {},
    input,
    word,
    code,
    element("span", { class: "share" }, share),
  );
  return {
    item: element("li", {}, label),
    /** @param {number[]} rgb @param {boolean} changed since its name was given */
    show(rgb, changed) {
      input.value = code.textContent = hexOf(rgb);
      word.textContent = changed ? `was ${name}` : name;
      word.classList.toggle("was", changed);
    },
    /** @param {(rgb: number[]) => void} see @param {() => void} keep when it is chosen */
    onColor(see, keep) {
      input.addEventListener("input", () => see(rgbOf(input.value) ?? [0, 0, 0]));
      input.addEventListener("change", keep);
    },
  };
}

/** @param {number} share @returns {string} */
function shareWords(share) {
  if (!share) return "";
  return share < 0.005 ? "< 1 %" : `${(share * 100).toFixed(0)} %`;
}

/** @param {number} share @returns {HTMLElement} */
function stripe(share) {
  const made = element("span");
  made.style.flexGrow = String(Math.max(100 * share, 0.5));
  return made;
}

/**
 * @param {import("./state.js").Store} store
 */
function createUndo(store) {
  /** @type {Coloring[]} */
  let past = [];
  /** @type {Coloring[]} */
  let future = [];
  const current = () => ({ colors: store.state.colors, ink: store.state.ink });
  let kept = current();
  const [undo, redo] = [part("undo", HTMLButtonElement), part("redo", HTMLButtonElement)];

  function show() {
    [undo.disabled, redo.disabled] = [!past.length, !future.length];
  }

  function keep() {
    const now = current();
    if (sameColoring(now, kept)) return;
    past.push(kept);
    [kept, future] = [now, []];
    show();
  }

  /** @param {Coloring[]} from @param {Coloring[]} to */
  function step(from, to) {
    const next = from.pop();
    if (!next) return;
    to.push(kept);
    kept = next;
    store.set(next);
    show();
  }

  undo.addEventListener("click", () => step(past, future));
  redo.addEventListener("click", () => step(future, past));
  addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || part("recolor", HTMLFieldSetElement).disabled) return;
    const key = event.key.toLowerCase();
    if (key === "z" && !event.shiftKey) step(past, future);
    else if (key === "y" || key === "z") step(future, past);
    else return;
    event.preventDefault();
  });
  show();
  return {
    keep,
    /** Begin anew: the colours came from elsewhere. */
    forget() {
      [past, future, kept] = [[], [], current()];
      show();
    },
  };
}

/** @param {Coloring} a @param {Coloring} b @returns {boolean} */
function sameColoring(a, b) {
  return sameColor(a.ink, b.ink) && a.colors.every((rgb, i) => sameColor(rgb, b.colors[i]));
}

/** @param {number} found @param {number} needed @returns {string} */
function countWords(found, needed) {
  const colors = `${found} ${found === 1 ? "colour" : "colours"}`;
  if (found === needed) return `${colors} taken.`;
  const paints = `${needed} ${needed === 1 ? "paint" : "paints"}`;
  const rest = found < needed ? "the other paints keep theirs" : "the rest is not used";
  return `${colors} for ${paints}; ${rest}.`;
}

/** @param {(file: File) => void} take a file that is opened or dropped */
function takeFiles(take) {
  const input = part("palette_file", HTMLInputElement);
  const body = document.body;
  part("open_palette", HTMLElement).addEventListener("click", () => input.click());
  input.addEventListener("change", () => {
    if (input.files?.length) take(input.files[0]);
    input.value = "";
  });
  addEventListener("dragover", (event) => {
    event.preventDefault();
    body.classList.toggle("dropping", !part("recolor", HTMLFieldSetElement).disabled);
  });
  addEventListener("dragleave", () => body.classList.remove("dropping"));
  addEventListener("drop", (event) => {
    event.preventDefault();
    body.classList.remove("dropping");
    const file = event.dataTransfer?.files[0];
    if (file && !part("recolor", HTMLFieldSetElement).disabled) take(file);
  });
}
