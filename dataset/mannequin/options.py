"""Define the default mannequin's options, proportions and pose. Imports nothing heavy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from toonset.errors import MeshError

Pose = Literal["T", "A", "relaxed"]
POSES: tuple[Pose, ...] = get_args(Pose)
HEADS_TALL = (2.0, 8.0)
SCALES = (0.7, 1.4)  # thinner, a limb falls between two grid layers; thicker, arms touch the trunk


@dataclass(frozen=True)
class MannequinOptions:
    """Proportions and pose of the default mannequin.

    Attributes:
        heads_tall: height over the height of the head, 2 to 8. Of fourteen characters' outlines
            3 loses least in the worst case against each one's own best number.
        pose: arms level ("T"), half down ("A") or hanging ("relaxed"); where short thick arms would
            touch the hips they are raised until they do not.
        head_scale: width and depth of the head, 0.7 to 1.4 (its height follows `heads_tall`).
        torso_scale: width and depth of the trunk, shoulders and hips with it, 0.7 to 1.4.
        limb_scale: thickness of arms, legs, hands and feet, 0.7 to 1.4.
    """

    heads_tall: float = 3.0
    pose: Pose = "relaxed"
    head_scale: float = 1.0
    torso_scale: float = 1.0
    limb_scale: float = 1.0

    def __post_init__(self) -> None:
        """Refuse options that would not give a clean surface.

        Raises:
            MeshError: a number out of range, or an unknown pose.
        """
        ranges = {"heads_tall": HEADS_TALL}
        ranges |= dict.fromkeys(("head_scale", "torso_scale", "limb_scale"), SCALES)
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise MeshError(
                    f"mannequin: {name} is {value:g}, {low:g} to {high:g} is possible; change it"
                )
        if self.pose not in POSES:
            raise MeshError(f"mannequin: pose {self.pose!r} is unknown; choose {', '.join(POSES)}")
