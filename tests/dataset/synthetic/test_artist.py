"""Sheets as artists draw them: each habit alone, all of them together, and their truth."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from toonset.dataset.bundle.transforms_read import read_cameras
from toonset.dataset.images.picture import decode_rgba, encode_jpeg, load_rgba
from toonset.dataset.mannequin.make import Mannequin, default_mannequin
from toonset.dataset.mesh.load import save_obj
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.synthetic.artist_options import ArtistOptions, BodyErrors, Brushwork
from toonset.dataset.synthetic.body_error import deform
from toonset.dataset.synthetic.body_parts import find_body_parts
from toonset.dataset.synthetic.files import write_turnaround
from toonset.dataset.synthetic.options import ARTIST, CONDITIONS, SynthOptions
from toonset.dataset.synthetic.shadow import shadow_factor, times
from toonset.dataset.synthetic.turnaround import Turnaround, make_turnaround
from toonset.errors import SheetError
from toonset.mesh import Mesh
from toonset.palette.pixels.labels import UNLABELLED

SMALL = replace(CONDITIONS["artist"], views=4, cell_px=96, outline_px=2.0, supersample=2)
SKIN, SHIRT = (230, 180, 150), (60, 110, 190)


@pytest.fixture(scope="module")
def mannequin() -> Mannequin:
    return default_mannequin()


@pytest.fixture(scope="module")
def body(mannequin: Mannequin) -> Mesh:
    mesh = mannequin.mesh
    assert mesh.face_parts is not None
    head = np.array([name == "head" for name in mesh.part_names])[mesh.face_parts]
    return replace(mesh, face_colors=np.where(head[:, None], SKIN, SHIRT).astype(np.uint8))


@pytest.fixture(scope="module")
def made(body: Mesh) -> Turnaround:
    return make_turnaround(body, SMALL, 1)


def alone(**habits: object) -> SynthOptions:
    """Return the small sheet's options with these habits and no others."""
    return replace(SMALL, artist=replace(ArtistOptions(), **habits))


def moved(body: Mesh, errors: BodyErrors, yaw: float = 0.0, seed: int = 0) -> np.ndarray:
    parts = find_body_parts(body, {})
    return deform(body, parts, errors, yaw, np.random.default_rng(seed)).vertices


def test_names_and_landmarks_agree_on_head_and_arms(mannequin: Mannequin) -> None:
    by_names = find_body_parts(mannequin.mesh, {})
    points = {name: tuple(point) for name, point in mannequin.landmarks.items()}
    by_bones = find_body_parts(mannequin.mesh, points)
    assert by_names.head is not None
    assert by_bones.head is not None
    pairs = [(by_names.head, by_bones.head), *zip(by_names.arms, by_bones.arms, strict=True)]
    assert len(pairs) == 3
    for one, other in pairs:
        both = (one.vertices & other.vertices).sum()
        assert both / (one.vertices | other.vertices).sum() > 0.75
        assert np.linalg.norm(one.joint - other.joint) < 0.08 * mannequin.mesh.height


def test_a_body_without_names_gets_the_smooth_field_alone(body: Mesh) -> None:
    unnamed = replace(body, face_parts=None, part_names=("body",))
    found = find_body_parts(unnamed, {})
    assert (found.head, found.arms) == (None, ())
    only_limbs = BodyErrors(head_turn_deg=4.0, arm_swing_deg=5.0, face_turn_deg=6.0)
    np.testing.assert_array_equal(moved(unnamed, only_limbs), body.vertices)
    assert np.abs(moved(unnamed, ARTIST.body) - body.vertices).max() > 0


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_field_is_as_large_as_asked_and_smooth(body: Mesh, seed: int) -> None:
    off = moved(body, BodyErrors(field_height_fraction=0.01), seed=seed) - body.vertices
    rms = math.sqrt((off**2).sum(axis=1).mean())
    assert rms == pytest.approx(0.01 * body.height, rel=0.3)  # set exactly over the surface
    edges = body.faces[:, :2]
    lengths = np.linalg.norm(np.diff(body.vertices[edges], axis=1), axis=2)
    steps = np.linalg.norm(np.diff(off[edges], axis=1), axis=2)
    assert (steps / lengths).max() < 0.4  # far from folding over


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_head_and_arms_turn_as_rigid_parts(body: Mesh, seed: int) -> None:
    parts = find_body_parts(body, {})
    after = moved(body, BodyErrors(head_turn_deg=4.0, arm_swing_deg=5.0), seed=seed)
    assert parts.head is not None
    still = ~parts.head.vertices
    for limb, most in ((parts.head, 4 * 1.5), *((arm, 5 * 2) for arm in parts.arms)):
        own = limb.vertices
        still &= ~own
        out, turned = body.vertices[own] - limb.joint, after[own] - limb.joint
        np.testing.assert_allclose(np.linalg.norm(out, axis=1), np.linalg.norm(turned, axis=1))
        far = np.linalg.norm(out, axis=1).argmax()
        cosine = out[far] @ turned[far] / (out[far] @ out[far])
        assert 0 < math.degrees(math.acos(min(cosine, 1))) <= most
    np.testing.assert_array_equal(after[still], body.vertices[still])


def test_face_is_pulled_to_the_viewer(mannequin: Mannequin) -> None:
    body = mannequin.mesh
    nose = int(np.linalg.norm(body.vertices - mannequin.landmarks["nose"], axis=1).argmin())
    errors = BodyErrors(face_turn_deg=10.0)
    sides = [moved(body, errors, yaw)[nose, 0] for yaw in (0.0, math.pi / 2, math.pi, -math.pi / 2)]
    assert sides[1] > 0.01 * body.height
    assert sides[3] == pytest.approx(-sides[1], abs=1e-3 * body.height)
    np.testing.assert_allclose([sides[0], sides[2]], body.vertices[nose, 0], atol=1e-9)


def test_no_strength_is_the_plain_drawing(body: Mesh) -> None:
    plain = make_turnaround(body, replace(SMALL, artist=ArtistOptions()), 1)
    none = make_turnaround(body, alone(body=ARTIST.body.scaled(0.0)), 1)
    np.testing.assert_array_equal(plain.sheet, none.sheet)
    assert not any(shadow.any() for shadow in plain.shadows)
    grainy = make_turnaround(body, alone(grain_levels=2.0, captions=True), 1)
    for view, same in zip(plain.views, grainy.views, strict=True):
        np.testing.assert_array_equal(view.rgba, same.rgba)
    off = grainy.sheet[:96].astype(float) - plain.sheet
    assert off[..., :3].std() == pytest.approx(2, rel=0.1)


def test_other_bodies_leave_cameras_and_other_habits_alone(body: Mesh) -> None:
    habits = {"elevation_jitter_deg": 1.0, "color_error_fraction": 0.03}
    still = make_turnaround(body, alone(**habits), 1)
    drifted = make_turnaround(body, alone(**habits, body=ARTIST.body), 1)
    scales = []
    for before, after in zip(still.cameras, drifted.cameras, strict=True):
        np.testing.assert_array_equal(before.rotation, after.rotation)
        np.testing.assert_array_equal(before.target, after.target)
        scales.append(after.scale / before.scale)
    np.testing.assert_allclose(scales, scales[0])  # one scale for all: the cells' room
    for one, other in zip(still.color_factors, drifted.color_factors, strict=True):
        np.testing.assert_array_equal(one, other)
    elevations = [math.degrees(camera.angles[1]) for camera in still.cameras]
    assert 0 < np.abs(np.subtract(elevations, SMALL.elevation_deg)).max() < 4
    assert any((a.rgba != b.rgba).any() for a, b in zip(still.views, drifted.views, strict=True))


def test_light_stays_with_the_camera(body: Mesh) -> None:
    shaded = make_turnaround(body, replace(alone(shadow_strength=0.3), yaw_jitter_deg=0.0), 1)
    skin = shaded.palette.tolist().index(list(SKIN))
    for labels, shadow in zip(shaded.labels, shaded.shadows, strict=True):
        _, columns = np.nonzero(labels != UNLABELLED)
        dark = shadow[labels != UNLABELLED]
        assert 0.15 < dark.mean() < 0.7
        assert columns[dark].mean() > columns[~dark].mean() + 2  # the light is at the left
        head = (labels == skin).nonzero()
        assert head[0][shadow[head]].mean() > head[0][~shadow[head]].mean()  # and above


def test_labels_and_shadows_say_every_pixels_colour(made: Turnaround) -> None:
    dark = shadow_factor(SMALL.artist.shadow_strength)
    for i, view in enumerate(made.views):
        pure, shadow, factor = made.labels[i] != UNLABELLED, made.shadows[i], made.color_factors[i]
        assert np.abs(factor - 1).max() <= SMALL.artist.color_error_fraction
        for where, light in ((pure & ~shadow, factor), (pure & shadow, factor * dark)):
            wanted = times(made.palette, light)[made.labels[i][where]]
            np.testing.assert_array_equal(view.rgba[where][:, :3], wanted)


def test_lines_differ_from_view_to_view_and_along_themselves(body: Mesh) -> None:
    wide = make_turnaround(body, alone(line_width_spread=0.5), 1)
    widths = [view.line_width_px for view in wide.views]
    assert 1 < max(widths) / min(widths) < 4
    assert all(0.5 * 0.75 * 2 <= width <= 1.5 * 1.25 * 2 for width in widths)


def test_captions_and_paper_do_not_break_the_cut(made: Turnaround) -> None:
    file = encode_jpeg(made.sheet, SMALL.artist.jpeg_quality)
    found = split_picture(decode_rgba(file, Path("sheet.jpg"))).views
    assert len(found) == len(made.views)
    for view, box in zip(found, made.figure_boxes, strict=True):
        np.testing.assert_allclose(view.figure_box, box, atol=3)


def test_exact_views_have_the_style_and_none_of_the_errors(body: Mesh) -> None:
    options = SMALL.without_error(4)
    exact = make_turnaround(body, options, 1)
    assert options.artist == ArtistOptions(shadow_strength=SMALL.artist.shadow_strength)
    yaws = np.degrees(exact.yaws)
    np.testing.assert_allclose(yaws, [0, 90, 180, 270], atol=1e-9)
    for view, camera in zip(exact.views, exact.cameras, strict=True):
        pixels, _, _ = camera.project(body.vertices)
        rows, columns = np.nonzero(view.mask)
        middle = [(each.min() + each.max() + 1) / 2 for each in (columns, rows)]
        np.testing.assert_allclose(middle, (pixels.min(axis=0) + pixels.max(axis=0)) / 2, atol=1)


def test_impossible_habits_are_refused() -> None:
    with pytest.raises(SheetError, match="need paper, the background is transparent"):
        replace(SMALL, background="transparent")
    with pytest.raises(SheetError, match=r"jpeg_quality: 101 is out of range; give 0 to 95"):
        ArtistOptions(jpeg_quality=101)
    with pytest.raises(SheetError, match="field_height_fraction: nan"):
        BodyErrors(field_height_fraction=math.nan)


def test_same_seed_same_bytes_and_the_truth_is_written(made, body, tmp_path, snapshot):
    write_turnaround(made, tmp_path / "a")
    write_turnaround(make_turnaround(body, SMALL, 1), tmp_path / "b")
    assert snapshot(tmp_path / "a") == snapshot(tmp_path / "b")
    assert (make_turnaround(body, SMALL, 2).sheet != made.sheet).any()
    assert not (tmp_path / "a" / "sheet.png").exists()
    truth = json.loads((tmp_path / "a" / "truth.json").read_text())
    assert truth["shadow"]["factor"] == pytest.approx([0.7, 0.715, 0.76])
    assert truth["options"]["artist"]["body"]["head_turn_deg"] == 4
    assert np.linalg.norm(truth["shadow"]["to_light"]) == pytest.approx(1, abs=0.01)
    for i, view in enumerate(truth["views"]):
        assert view["color_factor"] == list(made.color_factors[i])
        shadow = load_rgba(tmp_path / "a" / "shadows" / view["name"])[..., 0]
        np.testing.assert_array_equal(shadow == 255, made.shadows[i])
    plain = make_turnaround(body, replace(SMALL, artist=ArtistOptions()), 1)
    write_turnaround(plain, tmp_path / "plain")
    truth = json.loads((tmp_path / "plain" / "truth.json").read_text())
    assert "artist" not in truth["options"]
    assert "color_factor" not in truth["views"][0]


def test_command_takes_a_condition_and_what_is_typed(mannequin, tmp_path, monkeypatch, toonset):
    monkeypatch.setattr("toonset.cli.synth.TEST_VIEWS", 3)
    monkeypatch.chdir(tmp_path)
    unnamed = replace(mannequin.mesh, face_parts=None, part_names=("body",))
    Path("m.obj").write_bytes(save_obj(unnamed))
    size = ("--views", 3, "--cell", 64, "--warp", 0)
    asked = ("synth", "m.obj", "-q", "--condition", "artist", *size)
    assert toonset(*asked, "-o", "out").code == 0
    options = json.loads(Path("out/truth.json").read_text())["options"]
    assert (options["warp_percent"], options["yaw_jitter_deg"]) == (0, 5)
    assert options["artist"]["jpeg_quality"] == 88
    assert len(read_cameras(Path("out/test"))) == 3
    points = {name: point.tolist() for name, point in mannequin.landmarks.items()}
    marks = {"schema": "toonset-landmarks/1", "units": "world", "points": points}
    Path("m.landmarks.json").write_text(json.dumps(marks))
    assert toonset(*asked, "-o", "marked").code == 0
    assert Path("out/sheet.jpg").read_bytes() != Path("marked/sheet.jpg").read_bytes()
    assert toonset("synth", "m.obj", "-o", "x", "--condition", "artsy").code == 2


def test_painted_sheets_are_shaded_softly_and_say_which_paint_is_where() -> None:
    options = replace(CONDITIONS["painted"], views=2, cell_px=120, supersample=2)
    made = make_turnaround(random_body(2), options, 0)
    flat = replace(options, artist=replace(options.artist, brush=Brushwork()))
    for view, labels, plain in zip(
        made.views, made.labels, make_turnaround(random_body(2), flat, 0).labels, strict=True
    ):
        there = labels < 255
        assert (labels[there & (plain < 255)] == plain[there & (plain < 255)]).all()
        number = np.bincount(labels[there]).argmax()
        seen = view.rgba[labels == number][:, :3].astype(float)
        assert seen.std(axis=0).max() > 5
        assert (seen.mean(axis=0) < made.palette[number]).all()
    with pytest.raises(SheetError, match="soft_light"):
        Brushwork(soft_light=1.5)
