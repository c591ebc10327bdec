// The selected drawing's camera in numbers.

import { withView } from "./corrections.js";
import { part } from "../../viewer/page/elements.js";

const NO_BODY = "Click a drawing to choose it; its compass says from which side it is seen.";
const FIELDS = ["yaw", "elevation", "roll", "scale"];

/**
 * @param {import("./model.js").Model} model
 * @param {ReturnType<typeof import("./cameras_tool.js").createCamerasTool>} cameras
 */
export function createPosePanel(model, cameras) {
  const inputs = FIELDS.map((name) => part(`pose_${name}`, HTMLInputElement));
  const help = part("help_cameras", HTMLElement);
  const helpWithBody = help.textContent;
  const shift = ["x", "y"].map((name) => part(`pose_${name}`, HTMLInputElement));

  function show() {
    const figure = model.figure;
    const pose = figure && !figure.said?.exclude ? cameras.shownPose(figure) : null;
    part("pose_title", HTMLElement).textContent = figure ? `Drawing ${model.selected + 1}` : "No drawing";
    part("pose", HTMLFieldSetElement).disabled = !pose || !cameras.hasBody;
    part("no_body", HTMLElement).hidden = cameras.hasBody;
    help.textContent = cameras.hasBody ? helpWithBody : NO_BODY;
    part("forget_marks", HTMLButtonElement).disabled = !figure?.said?.landmarks?.length;
    if (!pose) return;
    const values = [pose.yaw, pose.elevation, pose.roll, pose.scale, ...pose.middle];
    [...inputs, ...shift].forEach((input, i) => {
      if (document.activeElement !== input) input.value = String(Number(values[i].toFixed(1)));
    });
  }

  inputs.forEach((input, i) =>
    input.addEventListener("change", () => {
      const value = Number(input.value);
      if (!model.figure || !input.value || !Number.isFinite(value)) return;
      if (FIELDS[i] === "scale" && value <= 0) return;
      const whole = FIELDS[i] === "elevation" ? Math.min(89, Math.max(-89, value)) : value;
      cameras.set(model.figure, { [FIELDS[i]]: whole });
    }),
  );
  shift.forEach((input) =>
    input.addEventListener("change", () => {
      const middle = shift.map((one) => Number(one.value));
      if (model.figure && middle.every(Number.isFinite)) cameras.set(model.figure, { middle });
    }),
  );
  part("add_mark", HTMLElement).addEventListener("click", () => {
    cameras.startMark();
    part("sheet", HTMLElement).focus();
  });
  part("forget_marks", HTMLElement).addEventListener("click", () => {
    if (model.figure) model.change(withView(model.said, model.figure.box, { landmarks: undefined }));
  });
  model.listen(show);
  show();
}
