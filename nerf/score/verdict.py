"""What a run says of itself: ok, or weak and why.

Drawings and field are as far apart as two lengths together, both in shares of the figure's height:

    off = outlines + pictures

`outlines` is what no single shape explains after all repairs, root mean square. `pictures` is the
squared error of the field's own pictures of the drawings, over that of drawings moved by a pixel: a
tenth of it counts as a tenth of a pixel. What differs between sheets, their colours and how much is
drawn, is in both and cancels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from toonset.dataset.bundle.scene import Scene
from toonset.dataset.silhouettes.mask import figure_px
from toonset.nerf.options import TrainOptions
from toonset.nerf.prepare.symmetry import with_mirrored
from toonset.nerf.prepare.view_coverage import guesses
from toonset.nerf.train.result import Training
from toonset.palette.pixels.labels import UNLABELLED
from toonset.view import over_white

OK, WEAK = "ok", "weak"
MOST_OFF = 0.0012  # a pixel out of place in a figure of 830 (docs/decisions.md)
BLENDS = 0.3  # of the figures' pixels; clean drawings of 80 px have 0.2, larger ones fewer
STANDS_OUT = 2.0  # times the sheet's: a drawing that is named

Picture = UInt8[np.ndarray, "height width 4"]


@dataclass(frozen=True)
class Off:
    """How far drawings and field are apart, in shares of the figure's height.

    Attributes:
        outlines: that no one shape explains, after repairs.
        pictures: of the field, beside the drawings.
        views: `pictures` of every drawing that shows a figure, by its name.
    """

    outlines: float
    pictures: float
    views: dict[str, float]

    @property
    def both(self) -> float:
        """Return the sum."""
        return self.outlines + self.pictures


@dataclass(frozen=True)
class Verdict:
    """What a run is worth.

    Attributes:
        verdict: OK or WEAK.
        reasons: why it is weak and what helps, a line each, for people.
        off: what it rests on.
    """

    verdict: str
    reasons: tuple[str, ...]
    off: Off

    def to_json(self) -> dict[str, Any]:
        """Return the verdict for a report, shares as they are."""
        off = {name: _rounded(value) for name, value in asdict(self.off).items()}
        return {
            "verdict": self.verdict,
            "reasons": list(self.reasons),
            "off_height": {"both": _rounded(self.off.both), "bound": MOST_OFF, **off},
        }


def verdict_of(training: Training, pictures: Sequence[Picture]) -> Verdict:
    """Return what a run is worth.

    Args:
        training: the run.
        pictures: of the field, one per drawing of `training.prepared`, seen by the same camera.
    """
    off = off_of(training.prepared.scene, pictures, training.prepared.outlines_px)
    reasons = guesses(with_mirrored(training.prepared.scene, training.symmetry))
    if off.both > MOST_OFF:
        reasons.append(f"{_measured(off)}; {_remedy(training, off)}")
    return Verdict(WEAK if reasons else OK, tuple(reasons), off)


def off_of(scene: Scene, pictures: Sequence[Picture], outlines_px: float) -> Off:
    """Return how far drawings and a field's pictures of them are apart.

    Args:
        scene: the drawings.
        pictures: one per drawing.
        outlines_px: by how much outlines disagree, pixels of the drawings.
    """
    pairs = [
        (over_white(picture), over_white(frame.rgba))
        for picture, frame in zip(pictures, scene.frames, strict=True)
    ]
    wrong = np.array([((shown - drawn) ** 2).sum() for shown, drawn in pairs])
    by_pixel = np.array([_moved_by_a_pixel(drawn) for _, drawn in pairs])
    sizes = [figure_px(frame) for frame in scene.frames]
    height = float(np.mean([size for size in sizes if size] or [1]))
    each = wrong / np.maximum(by_pixel, 1e-9) / height
    named = zip((frame.name for frame in scene.frames), each, sizes, strict=True)
    views = {name: float(share) for name, share, size in named if size}
    return Off(outlines_px / height, float(wrong.sum() / max(by_pixel.sum(), 1e-9)) / height, views)


def _moved_by_a_pixel(drawn: Float[np.ndarray, "height width 3"]) -> float:
    """Return the squared error of a drawing moved by a pixel, mean over both axes."""
    padded = np.pad(drawn, ((1, 1), (1, 1), (0, 0)), constant_values=1.0)
    return float(sum((np.diff(padded, axis=axis) ** 2).sum() for axis in (0, 1)) / 2)


def _measured(off: Off) -> str:
    """Return by how much a sheet is off, and which drawing is most."""
    said = (
        f"drawings and field are {100 * off.both:.2f} % of the height apart, where up to "
        f"{100 * MOST_OFF:.2f} % is ok"
    )
    name = max(off.views, key=off.views.__getitem__, default="")
    stands_out = off.views.get(name, 0.0) > STANDS_OUT * off.pictures
    return f"{said}, most in {name}" if stands_out else said


def _remedy(training: Training, off: Off) -> str:
    """Return what helps, by what is most likely the cause."""
    if off.outlines > MOST_OFF or not training.prepared.agree:
        return (
            "the drawings do not fit together better: `toonset consistency` shows how far each of "
            "them is off"
        )
    done = len(training.history)
    ended = training.stopped in ("steps", "budget") and training.options.field != "hull"
    if ended and done < TrainOptions().steps:
        return f"these were {done} steps: train longer"
    blends = blended(training.prepared.scene)
    if blends > BLENDS:
        return (
            f"{100 * blends:.0f} % of the figures' pixels are blends of two colours, as on lines "
            "and where pictures are small, blurred or saved as JPEG: larger, cleaner ones help"
        )
    return (
        "they show what one body cannot, as contour lines and shades that move with the viewer, or "
        "gaps painted shut: compare preview.png with them"
    )


def blended(scene: Scene) -> float:
    """Return the share of the figures' pixels that are no palette colour; 0 without labels."""
    figure, blends = 0, 0
    for frame in scene.frames:
        if frame.labels is not None:
            inside = frame.rgba[..., 3] > 0
            figure += int(inside.sum())
            blends += int((inside & (frame.labels == UNLABELLED)).sum())
    return blends / max(figure, 1)


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _rounded(number) for name, number in value.items()}
    return round(float(value), 6)
