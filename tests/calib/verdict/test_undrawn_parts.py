"""A part of the mannequin that is in no drawing is found, and one that is drawn is not."""

from dataclasses import replace

import numpy as np
import pytest

from tests.dataset.mesh.figure import BOXES, QUADS, box_points
from toonset.calib.verdict.undrawn_parts import undrawn_part
from toonset.camera import Camera
from toonset.dataset.mesh.rasterize import depth_map
from toonset.mesh import Mesh
from toonset.view import View

EXTRAS = {
    "sword": ((0.66, 0.6, 0.0), (0.72, 1.8, 0.1)),
    "floor": ((-0.8, -0.02, -0.8), (0.8, 0.0, 0.8)),
    "pet": ((0.9, 0.0, -0.3), (1.3, 0.5, 0.3)),
    "lamp": ((2.4, 2.8, 2.4), (2.6, 3.0, 2.6)),
    "room": ((-5.0, -1.0, -5.0), (5.0, 6.0, 5.0)),
}


def mesh_of(*names: str, named: bool = True) -> Mesh:
    """Return the figure with some extras; every box is a part."""
    boxes = [*BOXES.values(), *(EXTRAS[name] for name in names)]
    quads = np.concatenate([np.array(QUADS) + 8 * i for i in range(len(boxes))])
    faces = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    parts = np.repeat([0] * len(BOXES) + [1 + i for i in range(len(names))], 12)
    return Mesh(
        np.concatenate([box_points(box) for box in boxes]),
        faces,
        face_parts=parts if named and names else None,
        part_names=("body", *names) if named and names else ("body",),
    )


def cameras(elevation_deg: float = 5.0) -> list[Camera]:
    middle, elevation = np.array([0.0, 0.85, 0.0]), np.radians(elevation_deg)
    return [
        Camera.looking_at(middle, yaw, elevation, 100.0, (240, 240))
        for yaw in np.arange(8) * np.pi / 4
    ]


def drawn(mesh: Mesh, at: list[Camera]) -> list[View]:
    views = []
    for number, camera in enumerate(at):
        mask = np.isfinite(depth_map(mesh.vertices, mesh.faces, camera))
        rgba = np.where(mask[..., None], np.uint8(255), np.uint8(0)).repeat(4, axis=2)
        views.append(View(rgba, (0, 0, *camera.size_wh), 0.0, f"{number:03}.png"))
    return views


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("name", EXTRAS)
def test_a_part_that_nobody_drew(name: str, named: bool) -> None:
    at = cameras()
    views = drawn(mesh_of(), at)
    found = undrawn_part(mesh_of(name, named=named), at, views)
    assert found == (name if named else "piece of 12 faces")


@pytest.mark.parametrize("name", ["sword", "floor", "pet"])
def test_a_part_that_is_drawn_in_some_views(name: str) -> None:
    at, mesh = cameras(), mesh_of(name)
    assert undrawn_part(mesh, at, drawn(mesh, at)) == ""
    mixed = [*drawn(mesh, at)[:5], *drawn(mesh_of(), at)[5:]]
    assert undrawn_part(mesh, at, mixed) == ""


def test_the_body_itself_and_a_single_piece() -> None:
    at = cameras()
    assert undrawn_part(mesh_of(), at, drawn(mesh_of(), at)) == ""
    one = Mesh(mesh_of().vertices[:8], mesh_of().faces[:12])
    assert undrawn_part(one, at, drawn(mesh_of(), at)) == ""


def test_a_floor_seen_edge_on_is_found() -> None:
    at = cameras(0.0)
    assert undrawn_part(mesh_of("floor"), at, drawn(mesh_of(), at)) == "floor"


def test_what_lies_beyond_a_cut_is_not_missed() -> None:
    at = cameras()
    ends = (-np.inf, -np.inf, np.inf, 150.0)
    views = []
    for view in drawn(mesh_of(), at):
        rgba = view.rgba.copy()
        rgba[150:] = 0  # the legs are cut off
        views.append(replace(view, rgba=rgba, ends=ends))
    parts = np.repeat(np.arange(len(BOXES)), 12)
    mesh = replace(mesh_of(), face_parts=parts, part_names=tuple(BOXES))
    assert undrawn_part(mesh, at, views) == ""
    whole = [replace(view, ends=(-np.inf, -np.inf, np.inf, np.inf)) for view in views]
    assert undrawn_part(mesh, at, whole) in ("left", "right")
