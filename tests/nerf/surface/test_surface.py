"""A mesh of a field whose shape and colours are known: a striped ball."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from PIL import Image

from toonset.dataset.mesh.load import load_mesh
from toonset.errors import BundleError, OutputError, PaletteError
from toonset.nerf.fields.base import Constants, Field, Places
from toonset.nerf.fields.classifier import PaletteClassifier
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.hull.hull import Hull
from toonset.nerf.render.files import turntable_files
from toonset.nerf.render.layers import palette_picture
from toonset.nerf.render.turntable import turntable
from toonset.nerf.render.views import render
from toonset.nerf.surface.cut import cut
from toonset.nerf.surface.decimate import decimate
from toonset.nerf.surface.files import (
    Surface,
    check_mesh_files,
    mesh_files,
    split_by_label,
    write_mesh_files,
)
from toonset.nerf.surface.surface import surface_of

PALETTE = np.array([[200, 40, 40], [40, 80, 200], [250, 240, 10]], dtype=np.uint8)
RADIUS, VOXEL, CELLS = 1.0, 0.085, 31
EDGES = (-0.21, 0.37)  # heights at which colours change


class StripedBall(Field):
    """Red below, blue in the middle, yellow on top; dense where `density` says."""

    def __init__(self, density: float) -> None:
        super().__init__()
        self.density = density

    def constants(self, points_world: torch.Tensor) -> Constants:
        return Places(points_world)

    def shade(self, constants: Constants) -> tuple[torch.Tensor, torch.Tensor]:
        assert isinstance(constants, Places)
        return self(constants.points)

    def forward(self, points_world: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        number = torch.bucketize(points_world[:, 1].contiguous(), torch.tensor(EDGES))
        rgb = torch.as_tensor(PALETTE / 255, dtype=torch.float32)[number]
        return torch.full((len(points_world),), self.density), rgb

    def thin(self, by: float) -> None:
        raise NotImplementedError


class Nearest(PaletteClassifier):
    """Labels by the nearest palette colour."""

    def forward(self, rgb: torch.Tensor) -> torch.Tensor:
        palette = torch.as_tensor(PALETTE / 255, dtype=torch.float32)
        return -30 * torch.cdist(rgb, palette).square()


def ball(density: float = 40.0, extra: str = "") -> TrainedField:
    low = np.full(3, -VOXEL * CELLS / 2)
    hull = Hull(low, VOXEL, torch.zeros(CELLS, CELLS, CELLS))
    p = hull.centres()
    distance = RADIUS - p.norm(dim=1)
    if "speck" in extra:
        distance = torch.maximum(distance, 0.07 - (p - torch.tensor([1.2, 1.2, 1.2])).norm(dim=1))
    if "hollow" in extra:
        distance = torch.minimum(distance, p.norm(dim=1) - 0.5)
    support = (0.5 + distance / (2 * VOXEL)).clamp(0, 1).view(CELLS, CELLS, CELLS)
    hull.support.copy_(support)
    return TrainedField(StripedBall(density), hull, VOXEL, 60, Nearest(3), PALETTE, 0.0, 50)


@pytest.fixture(scope="module")
def surface() -> Surface:
    return surface_of(ball(), None)


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return float((np.cross(a, b) * c).sum() / 6)


def closed(faces: np.ndarray) -> bool:
    """Whether every edge is run along once in each direction."""
    edges = np.stack([faces.ravel(), np.roll(faces, -1, axis=1).ravel()], axis=1)
    there = {tuple(e) for e in edges.tolist()}
    return len(there) == len(edges) and {(b, a) for a, b in there} == there


def test_the_surface_is_the_ball(surface: Surface) -> None:
    assert closed(surface.faces)
    radius = np.linalg.norm(surface.vertices, axis=1)
    assert np.abs(radius - RADIUS).max() < 0.5 * VOXEL
    assert volume(surface.vertices, surface.faces) == pytest.approx(4 / 3 * np.pi, rel=0.03)
    edges = len(surface.faces) * 3 // 2
    assert len(surface.vertices) - edges + len(surface.faces) == 2
    assert len(np.unique(surface.vertices, axis=0)) == len(surface.vertices)
    for extra in ("speck", "hollow"):  # specks and cavities go
        found = surface_of(ball(extra=extra), None)
        assert volume(found.vertices, found.faces) == pytest.approx(
            volume(surface.vertices, surface.faces), rel=1e-3
        )


@pytest.mark.parametrize("faces", [None, 3000, 600])
def test_colours_meet_at_their_borders(faces: int | None) -> None:
    found = surface_of(ball(), faces)
    height = found.vertices[found.faces][..., 1]
    reach = VOXEL if faces != 600 else 2 * VOXEL  # few faces come from a coarser grid
    for label, (low, high) in enumerate(((-2, EDGES[0]), EDGES, (EDGES[1], 2))):
        mine = height[found.labels == label]
        assert len(mine) > 10
        assert mine.min() > low - reach
        assert mine.max() < high + reach


@pytest.mark.parametrize("wanted", [3000, 600, 100])
def test_fewer_faces_keep_the_shape(wanted: int) -> None:
    found = surface_of(ball(), wanted)
    assert wanted - 2 <= len(found.faces) <= wanted
    assert closed(found.faces)
    assert volume(found.vertices, found.faces) == pytest.approx(
        4 / 3 * np.pi, rel=0.06 if wanted > 100 else 0.1
    )


def test_shares_of_the_work_rise_to_its_end() -> None:
    told: dict[str, list[float]] = {}
    surface_of(ball(), 600, lambda step, done: told.setdefault(step, []).append(done))
    assert list(told) == ["finding the surface", "merging triangles"]
    for shares in told.values():
        assert len(shares) > 1
        assert shares == sorted(shares)
        assert 0 <= shares[0] < shares[-1] <= 1


def test_what_rays_pass_is_air() -> None:
    trained = ball()
    inner = trained.field

    class Half(StripedBall):
        def forward(self, points_world: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
            density, rgb = inner(points_world)
            return torch.where(points_world[:, 0] > 0, 0.0, density), rgb

    half = TrainedField(Half(40.0), trained.hull, VOXEL, 60, Nearest(3), PALETTE, 0.0, 50)
    found = surface_of(half, None)
    assert closed(found.faces)
    assert found.vertices[:, 0].min() < -0.9
    assert found.vertices[:, 0].max() < 0.4  # half of it, and the growth that outlines need


def test_a_field_of_nothing_is_refused() -> None:
    with pytest.raises(BundleError, match="nothing is opaque"):
        surface_of(ball(density=0.0))
    plain = ball()
    bare = TrainedField(plain.field, plain.hull, VOXEL, 60, None, None, 0.0, 50)
    with pytest.raises(PaletteError, match="without palette"):
        surface_of(bare)


def test_cuts_are_shared_and_keep_every_area() -> None:
    rng = np.random.default_rng(3)
    plain = surface_of(ball(), 600)
    chances = rng.dirichlet([0.4] * 4, len(plain.vertices))
    vertices, faces, labels = cut(plain.vertices, plain.faces, chances)
    assert closed(faces)
    assert volume(vertices, faces) == pytest.approx(volume(plain.vertices, plain.faces))
    label = chances.argmax(axis=1)
    old = faces < len(plain.vertices)
    assert (label[faces[old]] == np.repeat(labels[:, None], 3, axis=1)[old]).all()
    assert closed(decimate(vertices, faces, labels, 400)[1])


@pytest.mark.parametrize("name", ["b.glb", "b.obj", "b.ply", "odd name.obj"])
def test_files_hold_the_same_surface(tmp_path: Path, surface: Surface, name: str) -> None:
    files = mesh_files(surface, tmp_path / name)
    assert next(iter(files)) == name
    write_mesh_files(files, tmp_path / name, force=False)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(files)
    mesh = load_mesh(tmp_path / name)
    assert len(mesh.faces) == len(surface.faces)
    assert closed(mesh.faces)
    assert mesh.face_colors is not None
    places = mesh.vertices[mesh.faces]
    np.testing.assert_allclose(places, surface.vertices[surface.faces], atol=1e-6)
    np.testing.assert_array_equal(mesh.face_colors, PALETTE[surface.labels])
    if not name.endswith(".obj"):  # another program reads the same
        (other,) = trimesh.load_scene(tmp_path / name).geometry.values()
        other.merge_vertices(merge_tex=True, merge_norm=True)
        assert other.is_watertight
        assert other.volume > 0
    if name.endswith(".glb"):
        (other,) = trimesh.load_scene(tmp_path / name).geometry.values()
        colors = other.visual.to_color().vertex_colors[:, :3]
        assert {tuple(c) for c in colors.tolist()} == {tuple(c) for c in PALETTE.tolist()}


def test_only_border_vertices_come_twice(surface: Surface) -> None:
    vertices, labels, faces = split_by_label(surface)
    assert (labels[faces] == surface.labels[:, None]).all()
    twice = len(vertices) - len(surface.vertices)
    pairs = {(v, k) for f, k in zip(surface.faces.tolist(), surface.labels, strict=True) for v in f}
    assert twice == len(pairs) - len(surface.vertices) > 0


def test_all_formats_of_a_turn() -> None:
    trained = ball()
    cameras = turntable(trained, 4, 0.2, 24)
    pictures = [palette_picture(render(trained, camera), PALETTE) for camera in cameras]
    files = turntable_files(["gif", "webp", "sprites"], pictures, trained, cameras)
    assert list(files) == ["turntable.gif", "turntable.webp", "sprites.png", "sprites.json"]
    about = json.loads(files["sprites.json"])
    with Image.open(io.BytesIO(files["sprites.png"])) as image:
        assert image.size == (about["meta"]["size"]["w"], about["meta"]["size"]["h"])
    for frame in about["frames"].values():  # the ball stands on the pivot, seen a little from above
        assert frame["pivot"]["x"] == pytest.approx(0.5, abs=0.05)
        assert 0.85 < frame["pivot"]["y"] <= 1


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"end -o in \.glb"):
        check_mesh_files(tmp_path / "a.fbx", force=False)
    (tmp_path / "a.png").write_bytes(b"a drawing")
    with pytest.raises(OutputError, match=r"a\.png: exists already"):
        check_mesh_files(tmp_path / "a.obj", force=False)
    check_mesh_files(tmp_path / "a.glb", force=False)
    check_mesh_files(tmp_path / "a.obj", force=True)
    (tmp_path / "b.glb").mkdir()
    with pytest.raises(OutputError, match="is a folder"):
        check_mesh_files(tmp_path / "b.glb", force=True)
