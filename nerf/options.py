"""Define the options of training and rendering. Imports nothing heavy."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any, Literal, get_args

from toonset.errors import UsageError
from toonset.options import SYMMETRIC, Symmetric


class Layer(StrEnum):
    """Layers of a rendering."""

    drawn = "drawn"
    rgb = "rgb"
    palette = "palette"
    depth = "depth"
    labels = "labels"
    alpha = "alpha"
    ink = "ink"
    source = "source"
    normal = "normal"
    normal_camera = "normal-camera"


LAYERS = tuple(layer.value for layer in Layer)
FieldName = Literal["auto", "triplane"]
FIELDS: tuple[FieldName, ...] = get_args(FieldName)
DeviceName = Literal["auto", "cpu", "cuda"]
DEVICES: tuple[DeviceName, ...] = get_args(DeviceName)
PresetName = Literal["fast", "paper"]
PRESETS: tuple[PresetName, ...] = get_args(PresetName)
# Of all views of a turn together; "svg": a file per view
FORMATS = ("gif", "webp", "mp4", "sprites", "ora", "svg")
LEAST = {"steps": 1, "budget_s": 0, "seed": 0, "resolution": 2, "missing_views": 0}
LEAST |= {"smoothness": 0, "palette_weight": 0}
MOST_STEPS = 10_000_000  # days
ORIGINAL = "original"  # of a mesh's variants: the run's own colours
FACES = 8000  # of a mesh at most: docs/decisions.md
# By default: on the drawings' hull, on the mannequin's shape, on sections; more gain nothing there
USUAL_STEPS, STEPS_ON_SHAPE, STEPS_ON_SECTIONS = 600, 300, 100
PAPER_STEPS = 2000


@dataclass(frozen=True)
class TrainOptions:
    """Settings of `toonset.train`; `None` means chosen from the scene.

    Attributes:
        steps: optimiser steps; None: 600, 300 on the mannequin's shape, 100 where few drawings give
            the shape by sections: more gain nothing there.
        budget_s: stop after this many seconds, drawings and hull included, but not before 30 steps;
            results then depend on the machine.
        seed: of initial weights and ray order. Same seed, same result, bit for bit, on one CPU.
        device: "auto" (a GPU where there is one), "cpu" or "cuda".
        resolution: cells of the planes along the character's longest side; None: one cell per
            pixel of the tallest figure, 48 to 256, or fewer (see `field`).
        smoothness: weight of the planes' total variation at eight views that agree; fewer views,
            and drawings that were bent or do not agree, get more.
        palette_weight: weight of the classifier's cross-entropy.
        missing_views: views that may call a point of the hull background; None: by evidence.
        field: what is fitted: "auto", planes with a small decoder, as coarse as predicts left-out
            drawings well (`plane_search`); "triplane", one cell per pixel.
        mannequin: take the mannequin's shape where it predicts drawings better than they predict
            each other (off: --no-mannequin).
        carve: sample inside the drawings' visual hull; False: along the whole rays through the
            figure's box, at new places in every step, against pictures over any backdrop.
        fairing: take the fairest surface inside the hull instead of the hull with its corners
            (off: --no-fairing).
        register: let cameras follow drawings that were placed or sized off (off: --no-register).
        unwarp: bend drawings back that disagree with the others' outlines (off: --no-unwarp).
        symmetric: mirror drawings for the side that no drawing shows: "auto" unless a front or back
            shows that left and right differ, "on" whatever they show, "off" never; None: as the
            bundle says, else "auto".
    """

    steps: int | None = None
    budget_s: float | None = None
    seed: int = 0
    device: str = "auto"
    resolution: int | None = None
    smoothness: float = 1e-3
    palette_weight: float = 0.003
    missing_views: int | None = None
    field: FieldName = "auto"
    mannequin: bool = True
    carve: bool = True
    fairing: bool = True
    register: bool = True
    unwarp: bool = True
    symmetric: Symmetric | None = None

    def check(self) -> None:
        """Refuse options out of range.

        Raises:
            UsageError: a number out of range, a switch that is neither on nor off, no such field
                or device.
        """
        for name, kind in TrainOptions.__annotations__.items():
            value = getattr(self, name)
            if kind == "bool" and not isinstance(value, bool):
                raise UsageError(f"{name}: {value!r} is neither True nor False")
            if name in LEAST and value is not None:
                number = isinstance(value, int if "int" in kind else int | float)
                most = MOST_STEPS if name == "steps" else 2**63 - 1
                if not number or not LEAST[name] <= value <= most:
                    allowed = f"{LEAST[name]} is the least, {most:.15g} the most"
                    raise UsageError(f"{name}: {value} is out of range; {allowed}")
        choices_of = {"field": FIELDS, "device": DEVICES, "symmetric": (None, *SYMMETRIC)}
        for name, choices in choices_of.items():
            if getattr(self, name) not in choices:
                known = ", ".join(map(str, choices))
                raise UsageError(f"{name}: {getattr(self, name)!r} is none of {known}")


def preset(name: str) -> dict[str, Any]:
    """Return the options of a preset that differ from the defaults; "fast" is the defaults."""
    if name == "fast":
        return {}
    defaults = asdict(TrainOptions())
    return {key: value for key, value in asdict(paper()).items() if value != defaults[key]}


def paper(steps: int = PAPER_STEPS) -> TrainOptions:
    """Return the plain method: triplane, small decoder, classic volume rendering, classifier.

    Three planes with summed bilinear features; a decoder to density and colour; stratified samples
    along the whole rays through the figure's box, drawn anew in every step; pictures over backdrops
    of all colours; a classifier of one hidden layer on the rendered colour, whose labels are the
    nearest palette colours. No silhouette is used but to place the box, nothing is smoothed, and
    drawings are taken as they are. A step takes 1,024 rays of 96 samples.
    """
    return TrainOptions(
        steps=steps,
        palette_weight=0.01,
        field="triplane",
        mannequin=False,
        carve=False,
        smoothness=0.0,
        register=False,
        unwarp=False,
        symmetric="off",
    )
