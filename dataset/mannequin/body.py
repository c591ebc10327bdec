"""Build the default mannequin's solids round its joints, left side, in units of its height."""

from __future__ import annotations

from dataclasses import dataclass

from toonset.dataset.mannequin.joints import TRUNK_DEPTH, Joints, Sizes, hip_edge
from toonset.dataset.mannequin.solids import Solid, Vector, blended, ellipsoid, joined, limb

SEAM = 0.02  # neighbouring parts run into one another over this width
SMALLEST_NOSE = 0.014  # a smaller one falls between two grid layers
ARM = ("upper_arm", "forearm", "hand")
LEG = ("thigh", "shin", "foot")


@dataclass(frozen=True)
class Part:
    """A named part of the left side or the middle.

    Attributes:
        name: without its side.
        solid: its flesh.
        middle: the point round which it lies.
    """

    name: str
    solid: Solid
    middle: Vector


def parts_of(sizes: Sizes, joints: Joints) -> tuple[Part, ...]:
    """Return all parts; each overlaps its neighbours."""
    return (*_middle(sizes, joints), *_arm(sizes, joints), *_leg(sizes, joints))


def whole(parts: tuple[Part, ...]) -> Solid:
    """Return the parts as one solid, with soft seams where arms, legs and neck leave the trunk.

    Bones of one limb end in the same ball: joined without a seam they leave no bulge there.
    """
    groups = (("head",), ("neck",), ("torso",), ("pelvis",), ARM, LEG)
    grouped = (joined(*(p.solid for p in parts if p.name in group)) for group in groups)
    return blended(SEAM, *grouped)


def _middle(sizes: Sizes, joints: Joints) -> list[Part]:
    trunk, w = sizes.shoulder - sizes.crotch, sizes.torso
    chest_y, belly_y, hip_y = (sizes.crotch + share * trunk for share in (0.68, 0.42, 0.24))
    shoulder_x, shoulder_y, _ = joints["shoulder"]
    shoulder = (0.92 * shoulder_x, shoulder_y, 0.0)  # short of the arm's ball: no bulge
    ribs = (0.064 * w, shoulder_y - 0.025 * w, 0.0), (0.036 * w, belly_y, 0.0)
    torso = blended(
        0.03,
        ellipsoid((0, chest_y, 0.004), (0.09 * w, 0.36 * trunk, TRUNK_DEPTH * w)),
        ellipsoid((0, belly_y, 0.006), (0.095 * w, 0.34 * trunk, 0.087 * w)),
        limb(*ribs, 0.058 * w, 0.056 * w),  # narrows downwards: below the armpit arms only part
        limb((0, shoulder_y, 0), shoulder, sizes.arm + 0.01, max(0.037 * w, 0.95 * sizes.arm)),
    )
    hip_width = 0.9 * hip_edge(sizes, joints["hip"])  # thighs make the rest
    pelvis = ellipsoid((0, hip_y, -0.003), (hip_width, 0.32 * trunk, TRUNK_DEPTH * w))
    throat, nape = (0.0, sizes.shoulder, 0.0), (0.0, sizes.chin + 0.2 * sizes.head, 0.0)
    neck_radius = 0.024 + 0.07 * sizes.head
    return [
        Part("head", _head(sizes), (0, sizes.chin + sizes.head / 2, 0)),
        Part("neck", limb(throat, nape, neck_radius, neck_radius), throat),
        Part("torso", torso, (0, chest_y, 0)),
        Part("pelvis", pelvis, (0, hip_y, 0)),
    ]


def _head(sizes: Sizes) -> Solid:
    """Return skull, jaw and nose, the first two run into one another."""
    (width, depth), height, chin = sizes.head_widths, sizes.head, sizes.chin
    ahead = 0.06 * depth
    skull_at, jaw_at = (0.0, chin + 0.56 * height, -0.3 * ahead), (0.0, chin + 0.27 * height, ahead)
    nose = max(0.09 * height, SMALLEST_NOSE)
    nose_at = (0.0, chin + 0.36 * height, 0.46 * depth)
    return blended(
        0.06 * height,
        blended(
            0.2 * height,
            ellipsoid(skull_at, (width / 2, 0.44 * height, depth / 2)),
            ellipsoid(jaw_at, (0.38 * width, 0.27 * height, 0.38 * depth)),
        ),
        ellipsoid(nose_at, (nose, nose, 1.2 * nose)),
    )


def _arm(sizes: Sizes, joints: Joints) -> list[Part]:
    shoulder, elbow, wrist, hand = (joints[n] for n in ("shoulder", "elbow", "wrist", "hand"))
    r = sizes.arm
    thumb = (hand[0], hand[1], hand[2] + 1.1 * r)
    palm = blended(
        SEAM,
        limb(_between(wrist, hand, 0.35), hand, 0.95 * r, 0.75 * r),
        limb(_between(wrist, hand, 0.3), _between(wrist, thumb, 0.75), 0.55 * r, 0.5 * r),
    )
    return [
        Part("upper_arm", limb(shoulder, elbow, r, 0.88 * r), _between(shoulder, elbow, 0.5)),
        Part("forearm", limb(elbow, wrist, 0.88 * r, 0.76 * r), _between(elbow, wrist, 0.5)),
        Part("hand", palm, hand),
    ]


def _leg(sizes: Sizes, joints: Joints) -> list[Part]:
    hip, knee, ankle, toe = (joints[n] for n in ("hip", "knee", "ankle", "toe"))
    r = sizes.leg
    heel = (ankle[0], 0.62 * r, ankle[2] - 0.15 * r)  # balls as high as their radius: flat sole
    return [
        Part("thigh", limb(hip, knee, r, 0.8 * r), _between(hip, knee, 0.5)),
        Part("shin", limb(knee, ankle, 0.8 * r, 0.56 * r), _between(knee, ankle, 0.5)),
        Part("foot", limb(heel, toe, 0.62 * r, 0.55 * r), _between(heel, toe, 0.5)),
    ]


def _between(a: Vector, b: Vector, share: float) -> Vector:
    x, y, z = (p + share * (q - p) for p, q in zip(a, b, strict=True))
    return x, y, z
