"""calibration.json of version 1 in the shape of version 2.

While version 1 grew, `distance_heights` was one number or None for the sheet before it was a list,
the evidence stood beside it as `bic_gain_of_perspective` and one `bic_margin` for all, the drawing
error was one number, and `inputs` was a table of hashes, then a list without roles. All held
`seconds`, which made two runs' bytes differ; version 2 does not.
"""

from __future__ import annotations

from typing import Any


def upgraded(content: dict[str, Any]) -> dict[str, Any]:
    """Return a version 1 file as version 2; what is not as it was is left for the schema."""
    found = dict(content)
    found.pop("seconds", None)
    model = found.get("camera_model")
    if isinstance(model, dict):
        views = found.get("views")
        found["camera_model"] = _model(model, len(views) if isinstance(views, list) else 0)
    if "outline_noise_of_height" in found:
        noise = found.pop("outline_noise_of_height")
        found["drawing_error_of_height"] = {"smooth": 0.0, "white": noise}
    found["inputs"] = _inputs(found.get("inputs", []))
    return found


def _model(model: dict[str, Any], views: int) -> dict[str, Any]:
    found = dict(model)
    margin = found.pop("bic_margin", None)
    if "bic_gain_of_perspective" in found:
        gain = found.pop("bic_gain_of_perspective")
        found["tried"] = [{"model": "perspective", "bic_gain": gain, "unknowns": 1}]
    if not isinstance(found.get("distance_heights"), list):
        found["distance_heights"] = [found.get("distance_heights")] * views
    tried = found.get("tried")
    if margin is not None and isinstance(tried, list):
        found["tried"] = [
            {"margin": margin, **rung} if isinstance(rung, dict) else rung for rung in tried
        ]
    return found


def _inputs(inputs: Any) -> Any:
    if isinstance(inputs, dict):
        inputs = [{"name": name, "sha256": digest} for name, digest in inputs.items()]
    if not isinstance(inputs, list):
        return inputs
    return [{"role": "input", **one} if isinstance(one, dict) else one for one in inputs]
