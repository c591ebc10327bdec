"""Characters for messy sheets, modelled roughly and rendered all round.

Each is a `random_body` in clothes of random colours with some of: hat, cape, skirt, ears, tail and
a staff. A floating one has its hat in the air and hands without arms.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from toonset.dataset.bodies import random_body
from toonset.dataset.messy_figure import Cast, Figure, Rgb, cut_figure
from toonset.dataset.synth_options import SynthOptions
from toonset.dataset.synthetic import make_turnaround
from toonset.mesh import Mesh

HEAD_PARTS = ("neck", "head", "hair", "nose", "hat", "ear")
EXTRAS = ("hat", "cape", "skirt", "ears", "tail", "staff")
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
    mesh = _character(number, colors, floats, rng)
    options = SynthOptions(
        views=views,
        cell_px=round(figure_px * 1.15),
        yaw_jitter_deg=float(rng.uniform(0, 6)),
        elevation_deg=float(rng.choice([0, 0, 5, 12])),
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
    number: int, colors: tuple[Rgb, ...], floats: bool, rng: np.random.Generator
) -> Mesh:
    """Return a dressed body; floating ones always have a hat."""
    body = _recolored(random_body(number, symmetric=bool(rng.integers(2))), colors)
    chosen = {name for name in EXTRAS if rng.random() < 0.4}
    if floats:
        body = _only(body, [name for name in body.part_names if "arm" not in name])
        chosen = (chosen | {"hat"}) - {"staff"}
    extent = _extent(body, "head")
    shapes = [shape for name in EXTRAS if name in chosen for shape in _extra(name, extent, floats)]
    if "staff" in chosen:
        shapes.append(("staff", _staff(body)))
    if floats:
        shapes += _hands(rng)
    return _joined(body, shapes, colors)


def _recolored(body: Mesh, colors: tuple[Rgb, ...]) -> Mesh:
    assert body.face_colors is not None
    old = np.unique(body.face_colors, axis=0, return_inverse=True)[1].reshape(-1)
    painted = np.array([colors[i % len(colors)] for i in range(int(old.max()) + 1)], np.uint8)
    return replace(body, face_colors=painted[old])


def _only(mesh: Mesh, names: Any) -> Mesh:
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


def _extent(mesh: Mesh, name: str) -> tuple[float, float]:
    """Return (height of the middle, radius) of a part."""
    points = _only(mesh, (name,)).vertices
    low, high = points.min(axis=0), points.max(axis=0)
    return float(low[1] + high[1]) / 2, float(high[1] - low[1]) / 2


def _extra(name: str, head: tuple[float, float], floats: bool) -> list[tuple[str, Any]]:
    """Return named shapes of one extra, for a head at (height, radius)."""
    import trimesh

    make = trimesh.creation
    middle, radius = head
    if name == "hat":
        lift = (1.55 if floats else 0.75) * radius
        brim = make.cylinder(radius=1.25 * radius, height=0.12 * radius, sections=40)
        top = make.cone(radius=0.8 * radius, height=1.3 * radius, sections=40)
        return [("hat", _upright(shape, (0, middle + lift, 0))) for shape in (brim, top)]
    if name == "ears":
        ears = []
        for side in (-1, 1):
            ear = make.icosphere(subdivisions=3)
            ear.apply_scale((0.28 * radius, 0.75 * radius, 0.2 * radius))
            ear.apply_translation((side * 0.65 * radius, middle + 1.25 * radius, 0))
            ears.append(("ear", ear))
        return ears
    if name == "skirt":
        cone = make.cone(radius=0.36, height=0.9, sections=40)
        return [("skirt", _upright(cone, (0, 0.35, 0)))]
    if name == "cape":
        cape = make.icosphere(subdivisions=3)
        cape.apply_scale((0.3, 0.5, 0.06))
        cape.apply_translation((0, 0.72, -0.24))
        return [("cape", cape)]
    if name == "tail":
        ends = [[0, 0.65, -0.1], [0.05, 0.5, -0.55]]
        return [("tail", make.cylinder(radius=0.05, segment=ends, sections=20))]
    return []


def _upright(shape: Any, place: tuple[float, float, float]) -> Any:
    """Return a shape made along +Z, turned to stand along +Y at `place`."""
    import trimesh

    shape.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))
    shape.apply_translation(place)
    return shape


def _staff(body: Mesh) -> Any:
    """Return a staff in the right hand."""
    import trimesh

    arm = _only(body, ("right arm",)).vertices
    x, _, z = arm[np.argmin(arm[:, 0])]
    segment = [[x + 0.02, 0.02, z], [x + 0.02, 1.45, z]]
    return trimesh.creation.cylinder(radius=0.025, segment=segment, sections=16)


def _hands(rng: np.random.Generator) -> list[tuple[str, Any]]:
    import trimesh

    out, height = float(rng.uniform(0.36, 0.48)), float(rng.uniform(0.75, 1.0))
    hands = []
    for side in (-1, 1):
        hand = trimesh.creation.icosphere(subdivisions=3, radius=0.085)
        hand.apply_translation((side * out, height, 0.05))
        hands.append(("hand", hand))
    return hands


def _joined(body: Mesh, shapes: list[tuple[str, Any]], colors: tuple[Rgb, ...]) -> Mesh:
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
