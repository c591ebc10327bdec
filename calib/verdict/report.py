"""Report a calibration: the content of calibration.json, and one line per view."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from toonset.calib.result import Calibration, ViewCalibration
from toonset.camera import Camera
from toonset.dataset.bundle.calibration_schema import SCHEMA, VERSION, CalibratedCamera

FACING = math.radians(60.0)  # of yaw: what is turned away farther shows hardly any of a side
FROM_ABOVE = math.radians(50.0)  # sheets look down by 35 degrees at most (docs/decisions.md)
STRETCHED_BY = 0.005  # of height over width: less is how pictures are rounded to pixels


def calibration_dict(calibration: Calibration) -> dict[str, Any]:
    """Return the JSON form; angles in degrees, lengths in world units or pixels of the view.

    `seconds` is for the screen: `toonset.dataset.bundle.calibration_file` writes the rest, so that
    a bundle's bytes depend on its input alone.
    """
    model = calibration.model
    return {
        "schema": f"{SCHEMA}/{VERSION}",
        "verdict": calibration.verdict,
        "reason": calibration.reason,
        "camera_model": {
            "chosen": model.model,
            "distance_heights": [d if math.isfinite(d) else None for d in model.distances],
            "tried": [
                {
                    "model": model_test.name,
                    "bic_gain": model_test.bic_gain,
                    "margin": model_test.margin,
                    "unknowns": model_test.unknowns,
                }
                for model_test in model.tried
            ],
            "effective_samples": model.effective_samples,
        },
        "outline_offset_of_height": calibration.outline_offset,
        "drawing_error_of_height": {
            "smooth": calibration.noise.smooth,
            "white": calibration.noise.white,
        },
        "bodies_turn_deg": math.degrees(calibration.noise.turned),
        "drawings_contradiction_of_height": (
            calibration.contradiction if math.isfinite(calibration.contradiction) else None
        ),
        "views": [_view_dict(view) for view in calibration.views],
        "cut_off": [
            {"view": cut.view, "side": cut.flat.side, "lost_px": cut.lost_px}
            for cut in calibration.cuts
        ],
        "seconds": {step: round(value, 4) for step, value in calibration.seconds.items()},
        "filled_holes": [asdict(hole) for hole in calibration.filled_holes],
        **_landmarks_dict(calibration),
        **calibration.origin,
    }


def _landmarks_dict(calibration: Calibration) -> dict[str, Any]:
    """Return the landmarks' entry; empty without landmarks."""
    fits = [
        {
            "view": fit.view,
            "rms_px": fit.rms_px,
            "misplaced": list(fit.misplaced),
            "perspective_bic_gain": fit.bic_gain,
        }
        for fit in calibration.landmarks
    ]
    return {"landmarks": fits} if fits else {}


def model_line(calibration: Calibration) -> str:
    """Return what camera model was chosen, for people."""
    model = calibration.model
    text = f"camera model: {model.model}"
    near, far = min(model.distances), max(model.distances)
    if math.isfinite(near):
        text += f" from {near:.1f}" + (f" to {far:.1f}" if far > near * 1.01 else "")
        text += " body heights"
    return text


def evidence_line(calibration: Calibration) -> str:
    """Return the evidence for the camera model: what larger models gained of what they need."""
    model = calibration.model
    tried = "; ".join(f"{r.name} {r.bic_gain:+.0f} of {r.margin:.0f}" for r in model.tried)
    evidence = f"BIC gain and what is needed: {tried}. " if tried else ""
    return f"  {evidence}{model.effective_samples:.0f} effective samples"


def view_line(view: ViewCalibration) -> str:
    """Return one line about a view for people."""
    yaw, elevation, _ = (math.degrees(a) for a in view.camera.angles)
    text = (
        f"{view.name}  yaw {round(yaw, 1) % 360:6.1f} +- {math.degrees(view.sigmas.yaw):4.1f}  "
        f"elevation {elevation:5.1f} +- {math.degrees(view.sigmas.elevation):4.1f}  "
        f"p_flip {view.p_flip:.2f}  {view.verdict}"
    )
    if abs(view.camera.pixel_aspect - 1) >= STRETCHED_BY:
        text += f" (drawn {view.camera.pixel_aspect:.2f} times as high)"
    return f"{text}: {view.reason}" if view.reason else text


def undrawn_line(calibration: Calibration) -> str:
    """Return which of front and back no drawing shows, and what stands in, for people; or ""."""
    yaws = [view.camera.angles[0] for view in calibration.views]
    sides = {"front": 0.0, "back": math.pi}
    missing = [
        name
        for name, to in sides.items()
        if all(abs(math.remainder(yaw - to, 2 * math.pi)) > FACING for yaw in yaws)
    ]
    if not missing:
        return ""
    return (
        f"nobody drew the {' and the '.join(missing)}: `toonset train` goes on with the paint "
        "beside it; add a drawing from there to have it your way"
    )


def lying_line(calibration: Calibration) -> str:
    """Return what to do if doubtful cameras look at the mannequin from far above, for people."""
    mesh = calibration.mesh
    if mesh is None or mesh.up == "z" or calibration.is_certain:
        return ""
    elevations = [abs(view.camera.angles[1]) for view in calibration.views]
    if sum(elevation > FROM_ABOVE for elevation in elevations) * 2 <= len(elevations):
        return ""
    return (
        "these cameras look at the mannequin from far above or below: does it lie on its back? if "
        "+Z is up in its file, give --up z"
    )


def _view_dict(view: ViewCalibration) -> dict[str, Any]:
    sigmas = view.sigmas
    return {
        "name": view.name,
        "verdict": view.verdict,
        "reason": view.reason,
        "camera": _camera_dict(view.camera),
        "sigma": {
            "yaw_deg": math.degrees(sigmas.yaw),
            "elevation_deg": math.degrees(sigmas.elevation),
            "roll_deg": math.degrees(sigmas.roll),
            "scale_relative": sigmas.scale_relative,
            "shift_px": sigmas.shift_px,
        },
        "covariance": view.covariance.tolist(),
        "covariance_of": "rotation vector in camera axes (rad), shift u v (px), log scale",
        "p_flip": view.p_flip,
        "twin": _camera_dict(view.twin),
        "alternatives": [
            {"probability": other.probability, "camera": _camera_dict(other.camera)}
            for other in view.alternatives
        ],
        "outline_error_of_height": view.outline_error,
        "outline_coverage": view.coverage,
    }


def _camera_dict(camera: Camera) -> dict[str, Any]:
    return CalibratedCamera.of(camera).model_dump(mode="json")
