// What the page knows: the bundle, what a person said, what is selected; undo and redo.

import { figuresOf } from "./corrections.js";
import { store, stored } from "./keeper.js";

/** @typedef {import("./types.js").Corrections} Corrections */
/** @typedef {import("./types.js").Figure} Figure */
/** @typedef {import("./types.js").Mode} Mode */
/** @typedef {import("./types.js").Scene} Scene */
/** @typedef {import("./keeper.js").News} News */
/** @typedef {ReturnType<typeof createModel>} Model */

const MOST_STEPS = 200;

/** @param {Scene} scene @param {Corrections} corrections */
export function createModel(scene, corrections) {
  const key = `toonset-steps-${scene.sheet.sha256}`;
  /** @type {{past: Corrections[], future: Corrections[], now: string} | null} */
  const kept = stored(sessionStorage, key);
  const goesOn = kept?.now === JSON.stringify(corrections);
  /** @type {(() => void)[]} */
  const listeners = [];
  const model = {
    scene,
    said: corrections,
    past: goesOn && kept ? kept.past : [],
    future: goesOn && kept ? kept.future : [],
    busy: false,
    error: "",
    trouble: "", // why nothing is kept, or no more
    /** @type {Mode} */
    mode: startsWithFigures(scene, corrections) ? "figures" : "cameras",
    selected: 0,
    /** @type {number[]} figures that are selected besides */
    also: [],
    /** @type {(corrections: Corrections) => void} */
    save: () => {},
    /** @returns {Figure[]} */
    get figures() {
      return figuresOf(model.scene, model.said);
    },
    /** @returns {Figure | undefined} */
    get figure() {
      return model.figures[model.selected];
    },
    /** @param {() => void} listener called after every change */
    listen: (listener) => listeners.push(listener),
    tell() {
      for (const listener of listeners) listener();
    },
    /** @param {Partial<{mode: Mode, selected: number, also: number[]}>} change */
    show(change) {
      Object.assign(model, change);
      model.tell();
    },
    /** @param {Corrections} next what a person says now: it is kept */
    change(next) {
      if (JSON.stringify(next) === JSON.stringify(model.said)) return;
      model.past = [...model.past.slice(1 - MOST_STEPS), model.said];
      model.future = [];
      keep(next);
    },
    undo() {
      const last = model.past.at(-1);
      if (!last) return;
      model.past = model.past.slice(0, -1);
      model.future = [...model.future, model.said];
      keep(last);
    },
    redo() {
      const next = model.future.at(-1);
      if (!next) return;
      model.future = model.future.slice(0, -1);
      model.past = [...model.past, model.said];
      keep(next);
    },
    /** @param {News} news */
    take(news) {
      if (news.scene) model.scene = news.scene;
      if (JSON.stringify(news.corrections) !== JSON.stringify(model.said)) {
        model.past = [...model.past, model.said];
        model.future = [];
        model.said = news.corrections;
      }
      [model.busy, model.error, model.trouble] = [news.busy, news.error, ""];
      model.selected = Math.min(model.selected, Math.max(0, model.figures.length - 1));
      model.tell();
    },
  };

  /** @param {Corrections} next */
  function keep(next) {
    const { name, sha256, size } = model.scene.sheet;
    model.said = { ...next, sheet: { name, sha256, size } };
    [model.busy, model.trouble] = [true, ""];
    model.save(model.said);
    store(sessionStorage, key, { past: model.past, future: model.future, now: JSON.stringify(model.said) });
    model.tell();
  }

  return model;
}

/** @param {Scene} scene @param {Corrections} said @returns {boolean} whether there is a choice that nobody has made yet */
function startsWithFigures({ groups, leftOut }, said) {
  const choice = groups.flatMap(({ rows }) => rows).length > 1 || leftOut.some(({ kind }) => kind === "study");
  return choice && !(said.boxes || said.group || said.outfit || said.views);
}
