"""Characters for messy sheets, modelled roughly and rendered all round.

Each is a `random_body` in clothes of random colours with some of: hat, cape, skirt, ears, tail and
a staff. A floating one has its hat in the air and hands without arms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from bench.cases.bodies import random_body
from bench.messy.dress import EXTRAS, FLOAT_GAPS, Part, extra, hands, hat, staff
from bench.messy.figure import Cast, Figure, Rgb, cut_figure
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import make_turnaround
from toonset.mesh import Mesh

HEAD_PARTS = ("neck", "head", "hair", "nose", "hat", "ear")
LARGE_PX = 260  # from here on fewer samples a pixel show no steps
MOST_VIEWS = 8  # a turnaround's usual number; more figures repeat the round


@lru_cache(maxsize=16)
def solid_cast(
    number: int,
    views: int,
    figure_px: int,
    outline_px: float,
    colors: tuple[Rgb, ...],
    *,
    floats: bool,
    heads: bool,
) -> Cast:
    """Return a modelled character's turnaround.

    Args:
        number: which character; also the seed of its drawing error.
        views: drawings, at most 8.
        figure_px: about how tall they are.
        outline_px: width of the contour line, 0 = none.
        colors: sRGB of skin, hair, shirt, trousers, shoes and extras.
        floats: hat and hands hang in the air.
        heads: draw heads alone, too.
    """
    rng = np.random.default_rng(number)
    mesh = _character(number, colors, rng, floats=floats)
    options = SynthOptions(
        views=views,
        cell_px=round(figure_px * 1.15),
        yaw_jitter_deg=float(rng.uniform(0, 6)),
        elevation_deg=0.0 if floats else float(rng.choice([0, 0, 5, 12])),
        outline_px=outline_px,
        warp_percent=float(rng.uniform(0, 0.8)),
        supersample=3 if figure_px < LARGE_PX else 2,
    )
    close = replace(options, views=min(views, 3), cell_px=round(figure_px * 0.85))
    return Cast(
        _figures(mesh, options, number),
        _figures(_only(mesh, HEAD_PARTS), close, number) if heads else (),
        tuple(dict.fromkeys(colors)),
        outline_px,
    )


def _figures(mesh: Mesh, options: SynthOptions, seed: int) -> tuple[Figure, ...]:
    made = make_turnaround(mesh, options, seed)
    return tuple(cut_figure(view.rgba, ink) for view, ink in zip(made.views, made.ink, strict=True))


def _character(
    number: int, colors: tuple[Rgb, ...], rng: np.random.Generator, *, floats: bool
) -> Mesh:
    """Return a dressed body."""
    body = _recolored(random_body(number, symmetric=bool(rng.integers(2))), colors)
    worn = [name for name in EXTRAS if rng.random() < 0.4]
    with_hat, with_staff = rng.random(2) < 0.4
    low, high = _heights(body, ("head",))
    middle, radius = (low + high) / 2, (high - low) / 2
    if floats:
        trunk = _only(body, [name for name in body.part_names if "arm" not in name])
        return _joined(trunk, _floating(trunk, radius, rng), colors)
    shapes = [shape for name in worn for shape in extra(name, middle, radius)]
    shapes += hat(middle + 0.75 * radius, radius) if with_hat else []
    shapes += staff(_only(body, ("right arm",)).vertices) if with_staff else []
    return _joined(body, shapes, colors)


def _floating(body: Mesh, radius: float, rng: np.random.Generator) -> list[Part]:
    """Return a hat over the head and hands beside the trunk, in the air."""
    gaps = rng.uniform(*FLOAT_GAPS, size=2)
    crown = _heights(body, HEAD_PARTS)[1]
    level = float(rng.uniform(0.75, 1.0))
    return hat(crown + float(gaps[0]), radius) + hands(body.vertices, level, float(gaps[1]))


def _recolored(body: Mesh, colors: tuple[Rgb, ...]) -> Mesh:
    assert body.face_colors is not None
    old = np.unique(body.face_colors, axis=0, return_inverse=True)[1].reshape(-1)
    painted = np.array([colors[i % len(colors)] for i in range(int(old.max()) + 1)], np.uint8)
    return replace(body, face_colors=painted[old])


def _only(mesh: Mesh, names: Sequence[str]) -> Mesh:
    """Return the parts of a mesh with these names, its vertices welded down to the used ones."""
    assert mesh.face_parts is not None
    assert mesh.face_colors is not None
    numbers = [i for i, name in enumerate(mesh.part_names) if name in set(names)]
    kept = np.isin(mesh.face_parts, numbers)
    used, faces = np.unique(mesh.faces[kept], return_inverse=True)
    return replace(
        mesh,
        vertices=mesh.vertices[used],
        faces=faces.reshape(-1, 3),
        face_colors=mesh.face_colors[kept],
        face_parts=mesh.face_parts[kept],
    )


def _heights(mesh: Mesh, names: Sequence[str]) -> tuple[float, float]:
    """Return the lowest and the highest point of some parts."""
    y = _only(mesh, names).vertices[:, 1]
    return float(y.min()), float(y.max())


def _joined(body: Mesh, shapes: list[Part], colors: tuple[Rgb, ...]) -> Mesh:
    """Return the body with more parts; extras take the colours from the last one backwards."""
    assert body.face_parts is not None
    assert body.face_colors is not None
    vertices, faces = [body.vertices], [body.faces]
    painted, parts, names = [body.face_colors], [body.face_parts], list(body.part_names)
    offset = len(body.vertices)
    kinds = list(dict.fromkeys(name for name, _ in shapes))
    for name, shape in shapes:
        color = colors[0] if name == "hand" else colors[-1 - kinds.index(name) % len(colors)]
        vertices.append(np.asarray(shape.vertices))
        faces.append(np.asarray(shape.faces) + offset)
        painted.append(np.tile(np.array(color, np.uint8), (len(shape.faces), 1)))
        parts.append(np.full(len(shape.faces), len(names)))
        names.append(name)
        offset += len(shape.vertices)
    return Mesh(
        np.concatenate(vertices),
        np.concatenate(faces),
        np.concatenate(painted),
        np.concatenate(parts),
        tuple(names),
        body.name,
    )
