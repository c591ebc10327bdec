"""Pip the courier: our own character, part by part. +Y up, front +Z, her left at +X, 1.7 tall."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from solids import (
    Solid,
    below,
    blended,
    both_sides,
    box,
    chain,
    common,
    cone,
    ellipsoid,
    flattened,
    grown,
    ring,
    rounded_common,
    slab,
    triangles,
    turned,
    without,
)

from toonset.mesh import Mesh

HAIR = (217, 84, 48)
SKIN = (250, 205, 165)
COAT = (38, 138, 140)
SCARF = (246, 186, 62)
LEATHER = (124, 72, 48)
NAVY = (46, 58, 104)
CREAM = (250, 241, 222)
EYE = (36, 28, 48)
MOUTH = (176, 50, 58)
NOSE = (240, 160, 128)

FINE, MIDDLE, COARSE = 0.014, 0.025, 0.036  # triangle sizes in world units


@dataclass(frozen=True)
class Part:
    name: str
    color: tuple[int, int, int]
    solid: Solid
    cell: float


def character() -> Mesh:
    return mesh_of((*head(), *hair(), *clothes(), *limbs(), *baggage()), "character")


def mannequin() -> Mesh:
    """The same body in plain form, with the volume of hair and clothes but no detail of them."""
    legs = both_sides(blended(0.05, LEG, BOOT))
    arms = both_sides(blended(0.03, grown(SLEEVE, 0.006), PALM))
    body = blended(0.03, COAT_BODY, arms, legs, SCARF_ROUND)
    top = blended(0.02, SKULL, HAIR_CAP, FRINGE, NOSE_BALL, EARS)
    return mesh_of((Part("body", (204, 204, 204), blended(0.02, body, top), 0.038),), "mannequin")


def mesh_of(parts: tuple[Part, ...], name: str) -> Mesh:
    vertices, faces, colors, numbers, offset = [], [], [], [], 0
    for number, part in enumerate(parts):
        points, corners = triangles(part.solid, part.cell)
        vertices.append(points)
        faces.append(corners + offset)
        colors.append(np.tile(np.array(part.color, np.uint8), (len(corners), 1)))
        numbers.append(np.full(len(corners), number))
        offset += len(points)
    names = tuple(part.name for part in parts)
    return Mesh(
        np.concatenate(vertices),
        np.concatenate(faces),
        np.concatenate(colors),
        np.concatenate(numbers),
        names,
        name,
    )


# ---- the body ------------------------------------------------------------------------------------

SKULL = blended(
    0.09,
    ellipsoid((0, 1.30, 0), (0.28, 0.265, 0.26)),
    ellipsoid((0, 1.205, 0.035), (0.245, 0.155, 0.215)),
)
EARS = both_sides(ellipsoid((0.283, 1.235, -0.01), (0.04, 0.062, 0.042)))
NOSE_BALL = ellipsoid((0, 1.215, 0.262), (0.034, 0.028, 0.036))
HAIR_CAP = blended(
    0.05,
    ellipsoid((0, 1.345, -0.025), (0.325, 0.305, 0.305)),
    ellipsoid((0, 1.21, -0.11), (0.3, 0.2, 0.215)),
)
PARTING = (-0.1, 1.585, 0.12)
FRINGE = blended(
    0.012,
    chain(
        [PARTING, (0.05, 1.54, 0.21), (0.17, 1.46, 0.21), (0.245, 1.36, 0.16)],
        [0.05, 0.07, 0.055, 0.012],
        0.04,
    ),
    chain(
        [PARTING, (-0.03, 1.52, 0.235), (0.05, 1.445, 0.245), (0.12, 1.40, 0.24)],
        [0.05, 0.065, 0.045, 0.01],
        0.04,
    ),
    chain(
        [PARTING, (-0.17, 1.5, 0.19), (-0.225, 1.42, 0.17), (-0.25, 1.35, 0.15)],
        [0.05, 0.065, 0.045, 0.012],
        0.04,
    ),
)
SCARF_ROUND = flattened(ring((0, 0.985, 0.01), (0, 1, 0.08), 0.118, 0.064), 0.95)
COAT_BODY = common(
    flattened(
        blended(
            0.06,
            cone((0, 0.9, 0), (0, 0.52, 0), 0.13, 0.245),
            cone((-0.1, 0.9, 0), (0.1, 0.9, 0), 0.075, 0.075),
        ),
        0.84,
    ),
    below((0, 0.535, 0), (0, -1, 0)),
)
SLEEVE_LONG = cone((0.13, 0.9, 0), (0.37, 0.63, 0.02), 0.062, 0.098)
SLEEVE = common(SLEEVE_LONG, below((0.345, 0.66, 0.02), (0.66, -0.75, 0.05)))
PALM = blended(
    0.02,
    cone((0.33, 0.68, 0.02), (0.385, 0.605, 0.025), 0.045, 0.06),
    ellipsoid((0.395, 0.585, 0.03), (0.058, 0.066, 0.06)),
)
HAND = blended(0.02, PALM, cone((0.375, 0.6, 0.06), (0.355, 0.575, 0.1), 0.026, 0.022))
LEG = cone((0.102, 0.54, 0), (0.113, 0.18, 0), 0.092, 0.072)
BOOT = common(
    blended(
        0.06,
        cone((0.113, 0.19, 0), (0.115, 0.09, -0.005), 0.08, 0.075),
        turned(ellipsoid((0.122, 0.06, 0.05), (0.088, 0.075, 0.145)), (0.122, 0.06, 0), 0.18),
    ),
    below((0, 0, 0), (0, -1, 0)),
)


def head() -> tuple[Part, ...]:
    face = grown(SKULL, 0.007)
    eye = ellipsoid((0.112, 1.262, 0.24), (0.043, 0.066, 0.06))
    glint = ellipsoid((0.02, 0.028, 0), (0.021, 0.023, 0.1))
    glints = [lambda p, x=x: glint(p - [x, 1.262, 0.25]) for x in (0.112, -0.112)]
    brow = chain(
        [(0.075, 1.372, 0.22), (0.12, 1.378, 0.22), (0.165, 1.356, 0.2)], [0.011, 0.014, 0.01], 0.01
    )
    smile = common(
        ellipsoid((0, 1.158, 0.25), (0.062, 0.048, 0.12)), below((0, 1.158, 0), (0, 1, 0))
    )
    return (
        Part("head", SKIN, SKULL, COARSE),
        Part("ears", SKIN, EARS, 0.018),
        Part("nose", NOSE, NOSE_BALL, FINE),
        Part("eyes", EYE, common(face, both_sides(eye)), FINE),
        Part("glints", CREAM, common(grown(SKULL, 0.012), blended(1e-4, *glints)), 0.01),
        Part("brows", HAIR, common(grown(SKULL, 0.012), both_sides(deep(brow))), FINE),
        Part("mouth", MOUTH, common(face, smile), FINE),
        Part("neck", SKIN, cone((0, 0.93, 0), (0, 1.08, 0), 0.065, 0.065), COARSE),
    )


def deep(solid: Solid) -> Solid:
    """The solid stretched along z, so that a surface cuts its whole outline out."""
    return lambda p: solid(p * [1, 1, 0.15] + [0, 0, 0.85 * 0.215])


def hair() -> tuple[Part, ...]:
    opening = blended(
        0.06,
        ellipsoid((0, 1.225, 0.3), (0.247, 0.232, 0.27)),
        ellipsoid((0, 1.08, 0.28), (0.22, 0.2, 0.27)),
    )
    locks = both_sides(
        chain(
            [(0.27, 1.4, 0.1), (0.285, 1.26, 0.12), (0.255, 1.11, 0.15)], [0.07, 0.055, 0.012], 0.03
        )
    )
    tuft = chain(
        [(-0.09, 1.58, 0.04), (-0.07, 1.67, 0.02), (-0.01, 1.73, -0.04), (0.07, 1.735, -0.12)],
        [0.06, 0.047, 0.034, 0.02],
        0.03,
    )
    tail = chain(
        [
            (0.3, 1.47, -0.14),
            (0.41, 1.47, -0.17),
            (0.5, 1.36, -0.19),
            (0.52, 1.2, -0.18),
            (0.48, 1.06, -0.15),
            (0.53, 0.97, -0.13),
        ],
        [0.05, 0.09, 0.115, 0.1, 0.058, 0.014],
        0.05,
    )
    cap = blended(0.02, without(HAIR_CAP, opening), FRINGE, locks, tuft)
    return (
        Part("hair", HAIR, cap, 0.027),
        Part("ponytail", HAIR, tail, 0.027),
        Part(
            "hair band", SCARF, ring((0.315, 1.47, -0.145), (1, 0.05, -0.25), 0.052, 0.042), MIDDLE
        ),
    )


def clothes() -> tuple[Part, ...]:
    end = chain(
        [(0.05, 0.97, 0.24), (0.09, 0.86, 0.29), (0.11, 0.73, 0.36)], [0.045, 0.058, 0.078], 0.02
    )
    hem = rounded_common(0.012, grown(COAT_BODY, 0.016), slab((0, 0.555, 0), (0, 1, 0), 0.044))
    cuff = common(grown(SLEEVE_LONG, 0.014), slab((0.335, 0.67, 0.02), (0.66, -0.75, 0.05), 0.03))
    return (
        Part("coat", COAT, COAT_BODY, COARSE),
        Part("hem", CREAM, hem, 0.026),
        Part("sleeves", COAT, both_sides(SLEEVE), 0.03),
        Part("cuffs", CREAM, both_sides(cuff), MIDDLE),
        Part("scarf", SCARF, SCARF_ROUND, 0.028),
        Part("scarf end", SCARF, flattened(end, 0.5), MIDDLE),
    )


def limbs() -> tuple[Part, ...]:
    fur = both_sides(ring((0.113, 0.215, 0), (0.05, 1, 0), 0.062, 0.042))
    sole = common(grown(BOOT, 0.012), slab((0, 0.012, 0), (0, 1, 0), 0.02))
    return (
        Part("hands", SKIN, both_sides(HAND), MIDDLE),
        Part("legs", NAVY, both_sides(LEG), COARSE),
        Part("boots", LEATHER, both_sides(BOOT), 0.03),
        Part("soles", NAVY, both_sides(sole), MIDDLE),
        Part("boot fur", CREAM, fur, MIDDLE),
    )


def baggage() -> tuple[Part, ...]:
    strap = rounded_common(
        0.012, grown(COAT_BODY, 0.02), slab((0.0, 0.79, 0), (0.72, -0.69, 0), 0.03)
    )
    middle = (-0.262, 0.57, -0.02)
    bag = turned(box(middle, (0.054, 0.095, 0.118), 0.03), middle, 0.0, -0.25)
    lid = turned(box((-0.266, 0.625, -0.02), (0.066, 0.045, 0.128), 0.03), middle, 0.0, -0.25)
    clasp = turned(box((-0.33, 0.565, -0.02), (0.014, 0.026, 0.026), 0.01), middle, 0.0, -0.25)
    return (
        Part("strap", LEATHER, strap, 0.021),
        Part("bag", SCARF, bag, MIDDLE),
        Part("bag lid", LEATHER, lid, MIDDLE),
        Part("clasp", CREAM, clasp, FINE),
    )
