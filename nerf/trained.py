"""What training returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

from toonset.nerf.classifier import PaletteClassifier
from toonset.nerf.evidence import HullEvidence
from toonset.nerf.field_choice import FieldChoice
from toonset.nerf.fields import Field
from toonset.nerf.hull import Hull
from toonset.nerf.ink import InkStyle
from toonset.nerf.options import TrainOptions
from toonset.nerf.preparation import Prepared
from toonset.nerf.symmetry import Symmetry
from toonset.nerf.warp_back import KeyWarps

NO_PALETTE = (
    "run: was trained without palette; train again without --no-palette and without --field hull"
)


@dataclass(frozen=True, eq=False)
class TrainedField:
    """A field that can be rendered.

    Attributes:
        field: density and colour.
        hull: where the field is evaluated.
        step: distance of samples along rays, world units.
        samples: most samples per ray.
        classifier: colour to palette label; None without palette.
        palette: (colors, 3) sRGB; None without palette.
        k: 1 / distance of a typical training camera, 0 = orthographic; for turntables.
        size_px: longest side of the training pictures, for turntables.
        ink: contour lines that were taken off the drawings; None: there were none.
        keys: bends that were taken out of the drawings; None: there were none.
    """

    field: Field
    hull: Hull
    step: float
    samples: int
    classifier: PaletteClassifier | None
    palette: UInt8[np.ndarray, "colors 3"] | None
    k: float
    size_px: int
    ink: InkStyle | None = None
    keys: KeyWarps | None = None


@dataclass(frozen=True)
class Step:
    """One line of the training history: losses are means over the step's rays.

    `seconds` of training had passed when the step was done.
    """

    step: int
    loss: float
    photometric: float
    cross_entropy: float
    seconds: float


@dataclass(frozen=True)
class HeldOut:
    """Held-out views, looked at in between: a sample of them, so a little off the final figure.

    Attributes:
        step: steps done.
        seconds: of training.
        psnr: over white, mean of the views, dB.
    """

    step: int
    seconds: float
    psnr: float


@dataclass(frozen=True, eq=False)
class Training:
    """A trained field and how it came about.

    Attributes:
        result: the field.
        options: as given.
        history: every step.
        stopped: why it ended: "steps", "budget", "interrupted", or what went wrong at which step.
        prepared: the drawings as they were trained on, and what was done to them.
        evidence: for the hull's tolerance.
        seconds: of every part.
        counts: views, rays, samples, parameters.
        symmetry: what the drawings say of left and right, if that was asked; see there.
        choice: of the planes; None: it was not asked.
    """

    result: TrainedField
    options: TrainOptions
    history: tuple[Step, ...]
    stopped: str
    prepared: Prepared
    evidence: HullEvidence
    seconds: dict[str, float]
    counts: dict[str, int]
    symmetry: Symmetry | None = None
    choice: FieldChoice | None = None
