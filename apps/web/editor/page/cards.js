// A card per drawing: what the fit says of it, and what a person says.

import { createCompass, yawOfLabel } from "./compass.js";
import { withView } from "./corrections.js";
import { cameraSaid } from "./mannequin.js";
import { element, part } from "../../viewer/page/elements.js";
import { wrapped } from "../../viewer/page/state.js";
import { badge, reasonOf } from "../../viewer/page/verdict.js";

/** @typedef {import("./types.js").Figure} Figure */

/**
 * @param {import("./model.js").Model} model
 * @param {(figure: Figure) => import("./mannequin.js").Pose | null} poseShown
 * @param {(box: import("./types.js").Box) => void} look brings a drawing into sight
 */
export function createCards(model, poseShown, look) {
  /** @type {ReturnType<typeof createCard>[]} */
  let cards = [];
  let selected = model.selected;

  function show() {
    const figures = model.figures;
    if (cards.length !== figures.length) {
      cards = figures.map((_, i) => createCard(model, i, poseShown, look));
      part("cards", HTMLElement).replaceChildren(...cards.map((card) => card.item));
    }
    figures.forEach((figure, i) => cards[i].show(figure));
    if (model.selected === selected) return;
    selected = model.selected;
    const isBeside = model.mode === "cameras" && matchMedia("(min-width: 60rem)").matches;
    if (isBeside) cards[selected]?.item.scrollIntoView({ block: "nearest" });
  }

  model.listen(show);
  show();
}

/**
 * @param {import("./model.js").Model} model
 * @param {number} index
 * @param {(figure: Figure) => import("./mannequin.js").Pose | null} poseShown
 * @param {(box: import("./types.js").Box) => void} look
 */
function createCard(model, index, poseShown, look) {
  const number = index + 1;
  const name = element("button", { type: "button", class: "title" }, `Drawing ${number}`);
  const verdict = element("span", { class: "verdict" });
  const angle = element("span", { class: "angle" });
  const reason = element("p", { class: "reason", dir: "auto" });
  const figure = () => model.figures[index];
  const compass = createCompass(number, (label) => say({ label, camera: undefined }));
  const yaw = element("input", { type: "number", step: "any", "aria-label": `Yaw of drawing ${number}, degrees` });
  const [flip, lock, exclude, forget] = ["Flip", "Lock", "Leave out", "As found"].map((word) =>
    element("button", { type: "button", "aria-label": `${word}: drawing ${number}` }, word),
  );
  const item = element(
    "li",
    { class: "card" },
    element("div", { class: "bar head" }, name, verdict),
    compass.part,
    element("div", { class: "said" }, angle, element("label", {}, "Yaw ", yaw, "°")),
    reason,
    element("div", { class: "bar" }, flip, lock, exclude, forget),
  );

  /** @param {Partial<import("./types.js").ViewSaid>} change */
  function say(change) {
    model.change(withView(model.said, figure().box, change));
    model.show({ selected: index, also: [] });
  }

  /** @returns {number} as said, else as fitted */
  const yawNow = () => figure().said?.camera?.yaw ?? yawOfLabel(figure().said?.label) ?? figure().view?.yaw ?? 0;

  name.addEventListener("click", () => {
    model.show({ selected: index, also: [] });
    look(figure().view?.crop ?? figure().box);
  });
  yaw.addEventListener("change", () => {
    const value = Number(yaw.value);
    if (yaw.value && Number.isFinite(value)) say({ label: String(wrapped(value)), camera: undefined });
  });
  flip.addEventListener("click", () => say({ label: yawText(180 - yawNow()), camera: undefined }));
  lock.addEventListener("click", () => {
    const { said } = figure();
    if (said?.lock) return say({ lock: undefined });
    const pose = poseShown(figure());
    const known = yawOfLabel(said?.label) !== null || said?.camera;
    say({ lock: true, camera: known || !pose ? said?.camera : cameraSaid(pose), label: known ? said?.label : undefined });
  });
  exclude.addEventListener("click", () => say({ exclude: figure().said?.exclude ? undefined : true }));
  forget.addEventListener("click", () => {
    const nothing = { label: undefined, camera: undefined, lock: undefined, landmarks: undefined };
    say({ ...nothing, exclude: undefined });
  });

  return {
    item,
    /** @param {Figure} shown */
    show({ view, said }) {
      item.toggleAttribute("data-selected", model.selected === index);
      item.toggleAttribute("data-out", !!said?.exclude);
      name.setAttribute("aria-pressed", String(model.selected === index));
      const label = yawOfLabel(said?.label) === null ? undefined : said?.label;
      compass.show(view ? view.yaw : null, view?.sigma.yaw ?? 0, label);
      const excluded = !!said?.exclude;
      verdict.replaceChildren(excluded || !view ? "" : badge(view.verdict, view.verdict || "not rated"));
      angle.textContent = view && !excluded ? `${yawText(view.yaw)}° ± ${Math.max(1, Math.round(view.sigma.yaw))}°` : "";
      if (document.activeElement !== yaw) yaw.value = yawText(yawNow());
      reason.textContent = excluded
        ? "It is left out."
        : view
          ? `${view.caption ? `Its caption says ${view.caption}. ` : ""}${reasonOf(view)}${said?.landmarks?.length ? ` Landmarks: ${said.landmarks.length}.` : ""}`
          : "Not fitted yet.";
      for (const button of [flip, lock]) button.disabled = excluded || !view;
      lock.setAttribute("aria-pressed", String(!!said?.lock));
      exclude.textContent = excluded ? "Bring back" : "Leave out";
      exclude.setAttribute("aria-label", `${exclude.textContent}: drawing ${number}`);
      forget.disabled = !said;
    },
  };
}

/** @param {number} degrees @returns {string} */
function yawText(degrees) {
  return String(Number(wrapped(degrees).toFixed(1)));
}
