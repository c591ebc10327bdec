"""Define the result of training: the field, and its history."""

from __future__ import annotations

from dataclasses import dataclass

from toonset.dataset.bundle.scene import Scene
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.hull.tolerance import HullEvidence
from toonset.nerf.options import TrainOptions
from toonset.nerf.prepare.prepare import Prepared
from toonset.nerf.prepare.symmetry import Symmetry, add_mirrored_views
from toonset.nerf.train.plane_choice import FieldChoice


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
        options: as given, with the steps that the scene needs.
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

    @property
    def seen(self) -> Scene:
        """Return the drawings, agreeing with each other, and the mirror images of some."""
        return add_mirrored_views(self.prepared.scene, self.symmetry)
