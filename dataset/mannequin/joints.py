"""Compute the default mannequin's proportions and joints, in units of its height.

Everything is written for the left side, x >= 0; the right one is its mirror image. Proportions run
smoothly from a grown-up of 8 heads to a cartoon child of 2: with a larger head legs get shorter
and limbs thicker.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from toonset.dataset.mannequin.options import MannequinOptions, Pose
from toonset.dataset.mannequin.solids import Vector

ARM_FROM_VERTICAL: dict[Pose, float] = {"T": 90.0, "A": 45.0, "relaxed": 14.0}  # degrees, least
FOREARM_FORWARD: dict[Pose, float] = {"T": 0.0, "A": 0.0, "relaxed": 12.0}  # degrees
TRUNK_DEPTH = 0.09  # half of it: drawn trunks are deep
NECK_GAP = 0.025  # between chin and level arms
ARM_GAP = 0.03  # between a hanging arm and the hips: drawn, they are apart
LEG_GAP = 0.009  # least distance between a thigh and the middle

Joints = dict[str, Vector]


@dataclass(frozen=True)
class Sizes:
    """The proportions that follow from the options, in units of the height.

    Attributes:
        chin: height of the chin over the ground.
        shoulder: height of the shoulders' joints.
        crotch: height of the legs' fork.
        head: height of the head.
        head_widths: width and depth of the head.
        torso: factor on the trunk's width and depth.
        arm, leg: radius at shoulder and hip.
    """

    chin: float
    shoulder: float
    crotch: float
    head: float
    head_widths: tuple[float, float]
    torso: float
    arm: float
    leg: float


def sizes_of(options: MannequinOptions) -> Sizes:
    """Return the proportions that the options describe."""
    head = 1 / options.heads_tall
    arm, leg = (options.limb_scale * r for r in (0.022 + 0.068 * head, 0.042 + 0.07 * head))
    return Sizes(
        chin=1 - head,
        shoulder=1 - head - NECK_GAP - arm,
        crotch=(1 - head) * (0.6 - 0.48 * head),
        head=head,
        head_widths=(
            options.head_scale * head * (0.68 + 0.6 * head),
            options.head_scale * head * (0.8 + 0.25 * head),
        ),
        torso=options.torso_scale,
        arm=arm,
        leg=leg,
    )


def joints_of(sizes: Sizes, pose: Pose) -> Joints:
    """Return the middle's and the left side's joints, and the ends of hand and foot."""
    hip_x = max(0.058 * sizes.torso, sizes.leg + LEG_GAP)
    ankle_y = 0.04 + 0.3 * sizes.leg
    hip_y = sizes.crotch + 0.8 * sizes.leg
    foot = 0.10 + 0.3 * sizes.leg
    legs: Joints = {
        "hip": (hip_x, hip_y, 0),
        "knee": (1.03 * hip_x, (hip_y + ankle_y) / 2, 0.004),
        "ankle": (1.06 * hip_x, ankle_y, -0.008),
        "toe": (1.06 * hip_x + 0.01, 0.55 * sizes.leg, foot - 0.03),
    }
    return {"neck": (0, sizes.shoulder, 0), **_arm_joints(sizes, pose, legs["hip"]), **legs}


def _arm_joints(sizes: Sizes, pose: Pose, hip: Vector) -> Joints:
    """Return shoulder to fingertips: in the plane of the trunk, a hanging forearm turned ahead."""
    shoulder = (0.125 * sizes.torso, sizes.shoulder, 0.0)
    out = max(math.radians(ARM_FROM_VERTICAL[pose]), _past_hip(sizes, shoulder, hip))
    ahead = math.radians(FOREARM_FORWARD[pose])
    upper = math.sin(out), -math.cos(out), 0.0
    fore = upper[0] * math.cos(ahead), upper[1] * math.cos(ahead), math.sin(ahead)
    length = 0.36 * sizes.chin  # shoulder to wrist
    elbow = _moved(shoulder, upper, 0.52 * length)
    wrist = _moved(elbow, fore, 0.48 * length)
    hand = _moved(wrist, fore, 0.05 + 0.4 * sizes.arm)
    return {"shoulder": shoulder, "elbow": elbow, "wrist": wrist, "hand": hand}


def _past_hip(sizes: Sizes, shoulder: Vector, hip: Vector) -> float:
    """Return the arm's least angle from the vertical at which it does not hang into the hip."""
    across, down = hip[0] - shoulder[0], shoulder[1] - hip[1]
    apart = hip_edge(sizes, hip) - hip[0] + ARM_GAP + sizes.arm
    return math.atan2(across, down) + math.asin(min(apart / math.hypot(across, down), 1))


def hip_edge(sizes: Sizes, hip: Vector) -> float:
    """Return how far the hips reach to the side."""
    return max(0.1 * sizes.torso, hip[0] + sizes.leg)


def _moved(point: Vector, direction: Vector, by: float) -> Vector:
    x, y, z = (p + by * d for p, d in zip(point, direction, strict=True))
    return x, y, z
