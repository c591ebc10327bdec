"""Define the options of training, rendering and meshes. Imports nothing heavy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, get_args

from toonset.errors import UsageError
from toonset.options import MOST_SEED, Option, Symmetric, check_ranges, described

Layer = Literal[
    "drawn",
    "rgb",
    "palette",
    "depth",
    "labels",
    "alpha",
    "ink",
    "source",
    "normal",
    "normal-camera",
]
LAYERS: tuple[Layer, ...] = get_args(Layer)
REPAINTED = {"drawn", "palette", "labels"}  # layers in the palette's colours
FieldName = Literal["auto", "triplane"]
DeviceName = Literal["auto", "cpu", "cuda"]
PresetName = Literal["fast", "paper"]
# Of all views of a turn together; "svg": a file per view
Format = Literal["gif", "webp", "mp4", "sprites", "ora", "svg"]
MOST_STEPS = 10_000_000  # days
MOST_BUDGET_S = 1e9
ORIGINAL = "original"  # of a mesh's variants: the run's own colours
FEWEST_FACES = 100  # that show any figure
# By default: on the drawings' hull, on the mannequin's shape, on sections; more gain nothing there
USUAL_STEPS, STEPS_ON_SHAPE, STEPS_ON_SECTIONS = 600, 300, 100
PAPER_STEPS = 2000


@described
@dataclass(frozen=True)
class TrainOptions:
    """Settings of `toonset.train`; `None` means chosen from the scene.

    Same options, same result, bit for bit, on one CPU, unless a budget ends the training.
    """

    steps: Annotated[
        int | None,
        Option(
            "Optimiser steps (default: 600, or 300 on the mannequin's shape).",
            least=1,
            most=MOST_STEPS,
        ),
    ] = None  # 100 where few drawings give the shape by sections: more gain nothing there
    budget_s: Annotated[
        float | None,
        Option(
            "Stop after this time, drawings and hull included, but not before 30 steps; "
            "finer and coarser planes are not tried then.",
            flag="--budget",
            metavar="SECONDS",
            least=0.1,
            most=MOST_BUDGET_S,
        ),
    ] = None
    seed: Annotated[int, Option("Seed of everything random.", least=0, most=MOST_SEED)] = 0
    device: Annotated[DeviceName, Option("auto: a GPU where there is one.")] = "auto"
    resolution: Annotated[
        int | None,
        Option(
            "Cells of the planes along the character's longest side; None: one per pixel of the "
            "tallest figure, 48 to 256, or fewer (see `field`).",
            flag=None,
            least=2,
        ),
    ] = None
    smoothness: Annotated[
        float,
        Option(
            "Weight of the planes' total variation at eight views that agree; fewer views, and "
            "drawings that were bent or do not agree, get more.",
            flag=None,
            least=0,
        ),
    ] = 1e-3
    palette_weight: Annotated[
        float, Option("Weight of the classifier's cross-entropy.", flag=None, least=0)
    ] = 0.003
    missing_views: Annotated[
        int | None,
        Option(
            "Views that may call a point of the hull background; None: by evidence.",
            flag=None,
            least=0,
        ),
    ] = None
    field: Annotated[
        FieldName,
        Option("auto: planes as coarse as the drawings allow; triplane: one cell per pixel."),
    ] = "auto"
    mannequin: Annotated[
        bool,
        Option(
            "Learn the shape from the drawings alone, not the mannequin's.", flag="--no-mannequin"
        ),
    ] = True
    carve: Annotated[
        bool,
        Option(
            "Sample inside the drawings' visual hull; False: along the whole rays through the "
            "figure's box, at new places in every step, against pictures over any backdrop.",
            flag=None,
        ),
    ] = True
    fairing: Annotated[
        bool, Option("Keep the corners of the drawings' visual hull.", flag="--no-fairing")
    ] = True
    register: Annotated[
        bool, Option("Trust the cameras: do not register drawings.", flag="--no-register")
    ] = True
    unwarp: Annotated[
        bool, Option("Trust the outlines: do not unwarp drawings.", flag="--no-unwarp")
    ] = True
    symmetric: Annotated[
        Symmetric | None,
        Option(
            "Mirror drawings for the side that nobody drew: auto unless a front or back shows "
            "that left and right differ (default: as the bundle says, else auto)."
        ),
    ] = None

    def check(self) -> None:
        """Refuse options out of range.

        Raises:
            UsageError: a number out of range, a switch that is neither on nor off, no such field
                or device.
        """
        check_ranges(self)


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


PRESETS: Mapping[PresetName, Callable[[], TrainOptions]] = {"fast": TrainOptions, "paper": paper}


@described
@dataclass(frozen=True)
class RenderOptions:
    """Which pictures of a run `toonset render` writes, and in which colours and lines."""

    cameras: Annotated[Path | None, Option("A transforms.json: one picture per frame.")] = None
    turntable: Annotated[int | None, Option("N views all round.", least=1, most=3600)] = None
    elevation: Annotated[
        float | None,
        Option(
            "Turntable: degrees, > 0 looks down (default: as drawn).",
            least=-90,
            most=90,
            in_degrees=True,
        ),
    ] = None
    size: Annotated[
        int | None,
        Option("Side in px of a turntable view (default: as large as drawn).", least=8, most=4096),
    ] = None
    layers: Annotated[tuple[Layer, ...], Option("What is shown; repeatable.", flag="--layer")] = ()
    recolor: Annotated[
        tuple[str, ...],
        Option("OLD=NEW, e.g. '#aa0000=#00aa00' or 'teal=#00aa00'; repeatable; palette."),
    ] = ()
    palette: Annotated[
        str | None, Option("Other colours, a file or '#aa0000,#00aa00'; in order.")
    ] = None
    nearest: Annotated[bool, Option("Match --palette by likeness, not by order.")] = False
    lines: Annotated[
        bool, Option("Draw the outline of the drawn look.", flag="--lines/--no-lines")
    ] = True
    ink_width: Annotated[
        float | None, Option("Of the drawn outline, sheet px.", least=0.1, most=100)
    ] = None
    ink_color: Annotated[str | None, Option("Of the drawn outline, e.g. '#402010'.")] = None
    formats: Annotated[
        tuple[Format, ...],
        Option("Of all views together; svg: one per view.", flag="--format", listed=True),
    ] = ()
    gif: Annotated[
        bool | None, Option("turntable.gif (default: turntables).", flag="--gif/--no-gif")
    ] = None

    @property
    def repaints(self) -> bool:
        """Return whether colours of the palette are replaced."""
        return bool(self.recolor or self.palette)

    @property
    def together(self) -> tuple[Format, ...]:
        """Return the files that hold all views; a turntable has a GIF where nothing is said."""
        usual = self.turntable is not None and not self.formats
        wanted = usual if self.gif is None else self.gif
        return self.formats if "gif" in self.formats or not wanted else ("gif", *self.formats)

    def check(self) -> None:
        """Refuse what contradicts itself.

        Raises:
            UsageError: neither cameras nor a turntable, a layer twice, or colours for a layer that
                has none of the palette's.
        """
        if (self.cameras is None) == (self.turntable is None):
            raise UsageError("give either --cameras transforms.json or --turntable N")
        if self.cameras is not None and (self.elevation is not None or self.size is not None):
            raise UsageError("--elevation and --size belong to --turntable")
        if len(set(self.layers)) < len(self.layers):
            raise UsageError("--layer names a layer twice")
        if self.repaints and self.layers and not REPAINTED & set(self.layers):
            raise UsageError("colours can be replaced on --layer drawn and palette only")


@described
@dataclass(frozen=True)
class MeshOptions:
    """How `toonset mesh` makes a mesh of a run."""

    faces: Annotated[
        int,
        Option(
            "Triangles at most, if they can close it; 1000000: as fine as the run.",
            least=FEWEST_FACES,
        ),
    ] = 8000  # docs/decisions.md
    texture: Annotated[bool, Option("Paint it as the drawings are: .glb, .obj.")] = False
    outline: Annotated[bool, Option("With --texture: the sheet's outline as a hull: .glb.")] = False
    recolor: Annotated[tuple[str, ...], Option("OLD=NEW, e.g. '#aa0000=#00aa00'; repeatable.")] = ()
    variants: Annotated[
        tuple[str, ...],
        Option(
            "Other colours besides, a palette file or '#aa0000,#00aa00', in order; "
            "repeatable: .glb.",
            metavar="FILE",
        ),
    ] = ()
    nearest: Annotated[bool, Option("Match --variants by likeness, not by order.")] = False

    def check(self) -> None:
        """Refuse what contradicts itself.

        Raises:
            UsageError: an option without the one that it belongs to.
        """
        if self.outline and not self.texture:
            raise UsageError("--outline belongs to --texture")
        if self.nearest and not self.variants:
            raise UsageError("--nearest belongs to --variants")
