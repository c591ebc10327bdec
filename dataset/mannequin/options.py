"""Define the default mannequin's options, proportions and pose. Imports nothing heavy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from toonset.errors import MeshError
from toonset.options import Option, check_ranges, described

Pose = Literal["T", "A", "relaxed"]
LOW, HIGH = 0.7, 1.4  # thinner, a limb falls between two grid layers; thicker, arms touch the trunk


@described
@dataclass(frozen=True)
class MannequinOptions:
    """Proportions and pose of the default mannequin."""

    heads_tall: Annotated[
        float, Option("Height over the head's height.", flag="--heads", least=2.0, most=8.0)
    ] = 3.0  # of fourteen characters' outlines it loses least in the worst case
    pose: Annotated[Pose, Option("Arms level, half down, or hanging.", any_case=True)] = "relaxed"
    head_scale: Annotated[
        float,
        Option(
            "Width and depth of the head, times the usual.", flag="--head", least=LOW, most=HIGH
        ),
    ] = 1.0
    torso_scale: Annotated[
        float,
        Option(
            "Width and depth of the trunk, times the usual.", flag="--torso", least=LOW, most=HIGH
        ),
    ] = 1.0
    limb_scale: Annotated[
        float,
        Option(
            "Thickness of arms and legs, times the usual.", flag="--limbs", least=LOW, most=HIGH
        ),
    ] = 1.0

    def __post_init__(self) -> None:
        """Refuse options that would not give a clean surface.

        Raises:
            MeshError: a number out of range, or an unknown pose.
        """
        check_ranges(self, MeshError, "mannequin: ")
