"""The mannequin in the drawings' colours, a baseline of the training bench."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.cases.bodies import random_body
from bench.cases.cases import TrainCase, train_cases
from bench.train import mannequin_views
from bench.train.chart import draw_curves
from bench.train.mannequin_fit import fitted_mannequin
from bench.train.mannequin_views import mannequin_view, paint_mannequin
from bench.train.measure import run_jobs, table_of
from bench.train.plan import MANNEQUIN, METHODS, NEAREST, SCOPES, Job, plan
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.synthetic.gl_render import render_labels
from toonset.errors import BundleError
from toonset.mesh import Mesh
from toonset.nerf.score.metrics import compare, silhouette_iou

SIDE = 64
RED, GREEN, BLUE, YELLOW, GREY, BROWN = COLORS = (
    *((200, 40, 40), (40, 160, 60), (40, 60, 200)),
    *((230, 200, 40), (120, 120, 120), (120, 70, 30)),
)


def box(
    low: tuple[float, ...], high: tuple[float, ...], colors: tuple[tuple[int, ...], ...]
) -> Mesh:
    """Return a box whose sides are coloured: right, left, top, bottom, front, back."""
    import trimesh

    made = trimesh.creation.box(bounds=[low, high])
    axis = np.abs(made.face_normals).argmax(axis=1)
    side = 2 * axis + (made.face_normals[np.arange(12), axis] < 0)
    return Mesh(np.asarray(made.vertices), np.asarray(made.faces), np.array(colors, np.uint8)[side])


def both(one: Mesh, other: Mesh) -> Mesh:
    assert one.face_colors is not None
    assert other.face_colors is not None
    return Mesh(
        np.concatenate([one.vertices, other.vertices]),
        np.concatenate([one.faces, other.faces + len(one.vertices)]),
        np.concatenate([one.face_colors, other.face_colors]),
    )


def looking(yaw: float, k: float = 0.0, elevation: float = 0.3) -> Camera:
    return Camera.looking_at(np.zeros(3), yaw, elevation, SIDE / 4, (SIDE, SIDE), k=k)


def drawing(mesh: Mesh, camera: Camera) -> Frame:
    """Return what a camera sees of a mesh in its own colours, smooth at the edges."""
    assert mesh.face_colors is not None
    palette, labels = np.unique(mesh.face_colors, axis=0, return_inverse=True)
    seen = render_labels(mesh, labels.reshape(-1), camera.resized(4)).labels
    there = seen != 255
    rgba = np.zeros((*seen.shape, 4))
    rgba[there] = np.append(palette, np.full((len(palette), 1), 255), axis=1)[seen[there]]
    mean = rgba.reshape(SIDE, 4, SIDE, 4, 4).mean(axis=(1, 3))
    mean[..., :3] /= np.maximum(mean[..., 3:], 1e-9) / 255
    return Frame("a.png", camera, np.round(mean).astype(np.uint8))


def scene(mesh: Mesh, cameras: list[Camera]) -> Scene:
    return Scene(tuple(drawing(mesh, camera) for camera in cameras), None, "box")


def turn(count: int, first: float = 0.0, k: float = 0.0) -> list[Camera]:
    return [looking(first + 2 * np.pi * i / count, k) for i in range(count)]


BOX = box((-0.8, -1, -0.5), (0.8, 1, 0.5), COLORS)


def case(mannequin: Mesh | None = BOX) -> TrainCase:
    test = scene(BOX, turn(4, np.pi / 8))
    return TrainCase("box-exact", "exact", scene(BOX, turn(8)), test, mannequin)


@pytest.mark.parametrize("k", [0.0, 0.15])
def test_a_held_out_view_of_the_true_shape_comes_out_right(k: float) -> None:
    painted = paint_mannequin(BOX, scene(BOX, turn(8, k=k)))
    truth = drawing(BOX, looking(0.4, k))
    view = mannequin_view(painted, truth.camera)
    psnr = compare(view, truth.rgba)["psnr"]
    assert psnr is not None
    assert psnr > 30
    assert (silhouette_iou(view, truth.rgba) or 0) > 0.99
    sides = [(view[..., :3] == color).all(axis=-1).sum() for color in (RED, YELLOW, BLUE, GREY)]
    assert min(sides[0], sides[3]) > 100  # front, and what the viewer has on the right
    assert sides[1] == 0  # nobody sees the bottom


def test_what_hides_a_point_does_not_colour_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """From the front a red screen hides a blue box; from behind and below nobody sees its top."""
    screen = box((-0.7, -0.7, 0.9), (0.7, 0.7, 1.0), (RED,) * 6)
    small = box((-0.5, -0.5, -0.6), (0.5, 0.5, -0.2), (BLUE,) * 6)
    mesh = both(screen, small)
    drawings = scene(mesh, [looking(0.0, elevation=0.0), looking(np.pi, elevation=-1.0)])
    above = looking(0.0, elevation=1.3)
    of_small = np.repeat([0, 1], [len(screen.faces), len(small.faces)])
    there = render_labels(mesh, of_small, above).labels == 1
    assert there.sum() > 50
    painted = paint_mannequin(mesh, drawings)
    view = mannequin_view(painted, above)
    blue = (np.abs(view[..., :3].astype(int) - BLUE).max(axis=-1) < 60)[there].mean()
    assert blue > 0.9
    monkeypatch.setattr(mannequin_views, "HIDDEN_PX", np.inf)
    without = mannequin_view(painted, above)
    assert (np.abs(without[..., :3].astype(int) - BLUE).max(axis=-1) < 60)[there].mean() < 0.5


def test_a_point_beside_every_figure_takes_the_nearest_colour() -> None:
    grey = box((-0.8, -1, -0.5), (0.8, 1, 0.5), (GREY,) * 6)
    large = replace(grey, vertices=grey.vertices * 1.4)
    view = mannequin_view(paint_mannequin(large, scene(grey, turn(4))), looking(0.4))
    shown = view[view[..., 3] > 0]
    assert len(shown) > 1.5 * (drawing(grey, looking(0.4)).rgba[..., 3] > 0).sum()
    assert np.abs(shown[:, :3].astype(int) - GREY).max() <= 1


def test_a_mannequin_elsewhere_is_refused() -> None:
    aside = replace(BOX, vertices=BOX.vertices + np.array([50.0, 0, 0]))
    with pytest.raises(BundleError, match="box: no drawing shows"):
        paint_mannequin(aside, scene(BOX, turn(4)))


def test_another_body_gets_the_drawn_proportions() -> None:
    (made,) = train_cases(None, 1001, 1, px=64)
    assert made.mannequin is not None
    fitted = fitted_mannequin(made.mannequin, made.train)
    assert fitted.faces is made.mannequin.faces

    def overlap(mesh: Mesh) -> float:
        painted = paint_mannequin(mesh, made.train)
        views = [(mannequin_view(painted, f.camera), f.rgba) for f in made.test.frames]
        return float(np.mean([silhouette_iou(view, rgba) or 0 for view, rgba in views]))

    assert overlap(fitted) > overlap(made.mannequin) + 0.05
    own = random_body(1001)
    assert overlap(fitted_mannequin(own, made.train)) > overlap(own) - 0.01


def test_it_is_planned_where_there_is_a_mannequin() -> None:
    scope = SCOPES["train", False]
    jobs = [job for job in plan([case()], 0, "", scope) if job.method == MANNEQUIN]
    groups = [f"exact 64 px {n} views" for n in (8, 4, 3)]
    assert [job.group for job in jobs] == [*groups, "exact half turn 64 px 3 views"]
    assert {job.seed for job in jobs} == {0}
    without = plan([case(None)], 0, "", scope)
    assert {job.method for job in without} == set(scope.methods) - {MANNEQUIN}
    assert MANNEQUIN not in SCOPES["train", True].methods


def test_its_figures_stand_beside_the_others() -> None:
    jobs = [Job(case(), 8, method, 0) for method in (NEAREST, MANNEQUIN)]
    nearest, found = (result for _, result in run_jobs(jobs))
    assert found.note == nearest.note == ""
    assert found.figures.keys() == nearest.figures.keys()
    assert (found.figures["psnr"] or 0) > (nearest.figures["psnr"] or 99) + 10
    assert min(found.seconds, found.cpu_seconds, found.render_seconds) > 0
    (end,) = found.curve
    assert (end.seconds, end.psnr) == (found.seconds, pytest.approx(found.figures["psnr"]))
    rows = table_of([nearest, found]).splitlines()
    assert [row.startswith(MANNEQUIN) for row in rows] == [False, False, False, True]
    assert draw_curves([nearest, found], "") != draw_curves([nearest], "")


def test_without_a_mannequin_it_is_noted_not_replaced() -> None:
    ((_, found),) = run_jobs([Job(case(None), 8, MANNEQUIN, 0)])
    assert found.note == "box-exact: has no mannequin"


def test_synthetic_cases_have_another_body() -> None:
    (made,) = train_cases(None, 1000, 1, px=32)
    drawn = random_body(1000)
    assert made.mannequin is not None
    assert made.mannequin.bounds[:, 1] == pytest.approx(drawn.bounds[:, 1])
    assert np.abs(made.mannequin.bounds[:, 0] - drawn.bounds[:, 0]).max() > 0.01
    left = made.mannequin.vertices[made.mannequin.vertices[:, 0] > 1e-3]
    assert len(left) * 2 == (np.abs(made.mannequin.vertices[:, 0]) > 1e-3).sum()  # no bag


def test_folders_may_have_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("with-exact", "without-exact"):
        (tmp_path / name / "views").mkdir(parents=True)
        (tmp_path / name / "views" / "transforms.json").write_text("{}")
    (tmp_path / "with-exact" / "mannequin.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    monkeypatch.setattr("bench.cases.cases.read_scene", lambda place: case().train)
    found = {made.name: made.mannequin for made in train_cases(tmp_path, 0, 0)}
    assert found["without-exact"] is None
    mannequin = found["with-exact"]
    assert mannequin is not None
    assert mannequin.height == 2
    assert METHODS[MANNEQUIN].options is None
