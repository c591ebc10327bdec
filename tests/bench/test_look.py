"""The look bench: what is left out is left out, and eyes are counted as a person would."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.atlas import look as atlas_look
from bench.atlas.pages import LOOK_PAGES
from bench.atlas.results import LOOK, tried_pages
from bench.atlas.run import TriedStepResult
from bench.cases.bodies import random_body
from bench.charts.chart import DEFAULT
from bench.charts.points import charts_of
from bench.look.cases import DRAWN, LookCase, drawn_case, look_cases
from bench.look.eyes import Eye, check_eyes, eye_look, eyes_of_body, marked_eyes, read_eyes
from bench.look.measure import LookResult, bench_look, eyes_text, flicker, records_of, table_of
from bench.look.picture import draw_looks, face_sheet, look_sheet
from bench.look.plan import FIELD, LOOKS, Recipe, Variant
from bench.stability.bodies import with_eyes
from bench.train.peers import write_scene
from tests.nerf.look.painted import drawings
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.images.picture import encode_png
from toonset.dataset.mesh.load import save_obj
from toonset.errors import BundleError
from toonset.nerf.options import TrainOptions

SIDE, RADIUS = 200, 8.0
SKIN, DARK = (240, 190, 150), (20, 20, 30)
EYES = (Eye(np.array([-0.2, 0.1, 0.9]), 0.08), Eye(np.array([0.2, 0.1, 0.9]), 0.08))


# ---- eyes


def front_view(*spots: tuple[float, float, float], yaw: float = 0.0, lines: bool = False) -> Frame:
    """Return a face with dark discs: column, row, radius; `lines`: with a brow of 3 px."""
    camera = Camera.looking_at(np.zeros(3), yaw, 0.0, SIDE / 2, (SIDE, SIDE), k=0.0)
    rows, columns = np.ogrid[:SIDE, :SIDE]
    rgba = np.zeros((SIDE, SIDE, 4), np.uint8)
    rgba[5:195, 5:195] = (*SKIN, 255)
    for x, y, radius in spots:
        rgba[(columns - x) ** 2 + (rows - y) ** 2 <= radius**2, :3] = DARK
    if lines:
        rgba[68:71, 30:170, :3] = DARK
    return Frame("000.png", camera, rgba)


LEFT, RIGHT = (80.0, 90.0, RADIUS), (120.0, 90.0, RADIUS)


@pytest.mark.parametrize(
    ("spots", "faults"),
    [
        ((LEFT, RIGHT), ()),
        (((83, 88, RADIUS), RIGHT), ()),  # as far off as hands are
        (((80, 90, 0.8 * RADIUS), (120, 90, 1.2 * RADIUS)), ()),
        ((LEFT,), ("missing",)),
        (((80, 90, 4.5), RIGHT), ("small",)),
        ((LEFT, RIGHT, (100, 110, RADIUS)), ("extra",)),
        ((LEFT, (120, 83, 5), (120, 96, 5)), ("split",)),
        ((LEFT, (120, 90, 0.5 * RADIUS), (132, 106, RADIUS)), ("small", "extra")),
        ((), ("missing", "missing")),
    ],
)
@pytest.mark.parametrize("lines", [False, True])
def test_eyes_are_counted(
    spots: Sequence[tuple[float, float, float]], faults: tuple[str, ...], lines: bool
) -> None:
    truth = front_view(LEFT, RIGHT, lines=lines)
    seen = eye_look(EYES, Scene((truth,), None, "face"))
    assert seen is not None
    assert seen.colors[:, 0] == pytest.approx(np.tile(np.array(DARK) / 255, (2, 1)), abs=0.01)
    found = check_eyes(seen, truth, front_view(*spots, lines=lines).rgba)
    assert (found.expected, found.faults) == (2, faults)


def test_an_eye_that_the_truth_does_not_show_is_not_asked_for_but_may_not_be_drawn() -> None:
    both = front_view(LEFT, RIGHT)
    seen = eye_look(EYES, Scene((both,), None, "face"))
    assert seen is not None
    one = front_view(LEFT)
    assert check_eyes(seen, one, one.rgba).faults == ()
    assert check_eyes(seen, one, one.rgba).expected == 1
    assert check_eyes(seen, one, both.rgba).faults == ("extra",)
    behind = front_view(yaw=np.pi)
    assert check_eyes(seen, behind, both.rgba).expected == 0
    assert eye_look(EYES, Scene((behind,), None, "back")) is None
    assert eye_look((), Scene((both,), None, "face")) is None


def test_eyes_come_from_a_file_or_from_the_body(tmp_path: Path) -> None:
    assert read_eyes(tmp_path / "eyes.json") == ()
    path = tmp_path / "eyes.json"
    path.write_text(json.dumps({"eyes": [{"center": [1, 2, 3], "radius": 0.5}]}))
    (eye,) = read_eyes(path)
    assert (eye.center.tolist(), eye.radius) == ([1, 2, 3], 0.5)
    for wrong in ({}, {"eyes": [1]}, {"eyes": [{"center": [1, 2], "radius": 1}]}, []):
        path.write_text(json.dumps(wrong))
        with pytest.raises(BundleError, match=r'eyes\.json: no list "eyes"'):
            read_eyes(path)
    assert marked_eyes("nobody") == ()
    assert len(marked_eyes("kaykit_rogue")) == 2
    left, right = eyes_of_body(with_eyes(random_body(1), 0.03))
    assert left.radius == pytest.approx(0.03, rel=0.02)
    assert left.center * (-1, 1, 1) == pytest.approx(right.center)
    assert eyes_of_body(random_body(1)) == ()


# ---- cases and looks


def test_a_folder_without_cases_and_a_name_that_fits_none(tmp_path: Path, bench) -> None:
    with pytest.raises(BundleError, match="holds no case"):
        list(look_cases(tmp_path, 0, 1))
    assert "no case's name contains 'nobody'" in bench("look", "--only", "nobody").reason


def test_a_case_folder_comes_with_its_own_and_with_found_cameras(tmp_path: Path) -> None:
    case, made = drawn_case(3, replace(DRAWN, cell_px=100, views=4, outline_px=1))
    folder = tmp_path / "figure-drawn"
    write_scene(folder / "views", case.train)
    write_scene(folder / "test", case.test)
    (folder / "sheet.png").write_bytes(encode_png(made.sheet))
    (folder / "mannequin.obj").write_bytes(save_obj(made.mesh))
    places = [{"center": eye.center.tolist(), "radius": eye.radius} for eye in case.eyes]
    (folder / "eyes.json").write_text(json.dumps({"eyes": places}))
    (true,) = look_cases(tmp_path, 0, 1, quick=True)
    own, found = look_cases(tmp_path, 0, 1, "figure")
    assert (own.name, own.group) == (true.name, true.group) == ("figure", "drawn")
    assert (found.name, found.group) == ("figure", "drawn, calibrated")
    assert own.turn is None
    assert len(own.eyes) == 2
    assert [f.rgba.tobytes() for f in own.train.frames] == [
        f.rgba.tobytes() for f in case.train.frames
    ]
    pairs = zip(found.train.frames, own.train.frames, strict=True)
    off = [np.abs(a.camera.rotation - b.camera.rotation).max() for a, b in pairs]
    assert 0 < np.median(off) < 0.2
    (folder / "sheet.png").unlink()
    with pytest.raises(BundleError, match=r"holds no sheet\.png"):
        list(look_cases(tmp_path, 0, 1, "calibrated"))


@pytest.fixture(scope="module")
def short() -> Iterator[list[LookResult]]:
    """Return the looks of a small sheet after a short training."""
    known = dict(LOOKS)
    quick = TrainOptions(steps=30, field="triplane")
    for name, look in known.items():
        own = look.recipe.options
        options = replace(quick, mannequin=own.mannequin)
        LOOKS[name] = replace(look, recipe=Recipe(options, look.recipe.paint))
    case, made = drawn_case(0, replace(DRAWN, cell_px=80, outline_px=1.2, views=6))
    case = replace(case, train=replace(case.train, mannequin=made.mesh))
    turn = replace(case.test, frames=case.test.frames[:3])
    case = replace(case, turn=turn, test=replace(case.test, frames=case.test.frames[:3]))
    yield bench_look([case], 5)
    LOOKS.update(known)


def test_every_look_is_another(short: list[LookResult]) -> None:
    assert [one.look for one in short] == list(LOOKS)
    shown = {one.look: np.stack(one.pictures) for one in short}
    names = list(shown)
    for i, name in enumerate(names):
        for other in names[i + 1 :]:
            assert (shown[name] != shown[other]).any(), (name, other)
    by_name = {one.look: one for one in short}
    for one in short:
        for figure in ("flip", "dirt", "sharpness", "ink_f1", "label_miou_shift", "psnr_blocks"):
            assert one.figures[figure] is not None, (one.look, figure)
        assert one.figures["flicker"] is not None
        assert one.cpu_seconds > 0
    drawn, field = by_name[DEFAULT].figures, by_name[FIELD].figures
    assert drawn["dirt"] < field["dirt"]  # type: ignore[operator]
    assert by_name[DEFAULT].cpu_seconds > by_name["without flow"].cpu_seconds


def test_looks_are_records_a_table_a_chart_and_pictures(short: list[LookResult]) -> None:
    records = records_of(short, 5)
    found = {(record.method, record.metric): record for record in records}
    assert found[DEFAULT, "FLIP"].by_case == {"body 0": short[0].figures["flip"]}
    assert {record.seed for record in records} == {5}
    lines = table_of(short).splitlines()
    assert lines[0] == "drawn"
    assert [line[:24].strip() for line in lines[2:]] == list(LOOKS)
    seeing = sum(check.expected > 0 for check in short[0].checks)
    assert lines[2].endswith(f"of {seeing}")
    assert f"body 0, drawn, default: {seeing - 1}" in eyes_text(_one_wrong(short))
    (chart,) = charts_of("look", records, "seed 5")
    assert chart.lower_is_better
    assert chart.headline.startswith(f"default: FLIP {short[0].figures['flip']:#.3g} in ")
    assert {point.method for point in chart.points} == set(LOOKS)
    svg = draw_looks(short, "seed 5", "svg").decode()
    assert all(name in svg for name in LOOKS if name != DEFAULT)
    tall, wide, _ = look_sheet(short).shape
    assert wide == 230 * (len(LOOKS) + 1)
    assert tall > 3 * 230
    faces = face_sheet(_one_wrong(short)[:1])
    assert faces is not None
    assert faces.shape[1] == 8 * 150
    assert face_sheet([replace(short[0], checks=())]) is None


def _one_wrong(results: list[LookResult]) -> list[LookResult]:
    """Return the results with one fault among the checks of the first."""
    first = results[0]
    checks = [replace(check, faults=()) for check in first.checks]
    number = next(i for i, check in enumerate(checks) if check.expected)
    checks[number] = replace(checks[number], faults=("split",))
    return [replace(first, checks=tuple(checks)), *results[1:]]


def test_the_nearest_drawing_is_alone_and_flows_are_gone() -> None:

    whole = drawings()
    camera = whole.views[1].camera
    assert Variant(whole, "").seen_by(camera) is whole
    assert Variant(whole, "flow").seen_by(camera).flows == ()
    alone = Variant(whole, "vote")
    assert alone.seen_by(camera).views == (whole.views[1],)
    assert alone.seen_by(camera) is alone.seen_by(camera)  # its textures are made once


# ---- the atlas


def test_a_look_page_fails_where_the_field_is_better(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(atlas_look, "SHEET", replace(DRAWN, cell_px=60, outline_px=1, views=4))
    flips = {DEFAULT: 0.08, FIELD: 0.1}

    def told(cases: Sequence[LookCase], seed: int, looks: Sequence[str]) -> list[LookResult]:
        (case,) = cases
        pictures = tuple(frame.rgba for frame in case.test.frames)
        return [
            LookResult(case, name, seed, {"flip": flips[name]}, 1.0, pictures, ()) for name in looks
        ]

    monkeypatch.setattr(atlas_look, "bench_look", told)
    atlas_look._base_tried.cache_clear()
    page = next(page for page in LOOK_PAGES if page.name == "look warp")
    tried, picture = atlas_look.try_look(page, 2, 0)
    assert tried.figure == pytest.approx(20)
    assert tried.words == "FLIP 0.0800, of the field 0.1000"
    assert picture.startswith(b"\x89PNG")
    flips[DEFAULT] = 0.11
    worse, _ = atlas_look.try_look(page, 1, 0)
    assert atlas_look.try_look(page, 1, 0)[0] is worse  # the base, tried once
    steps = [
        TriedStepResult("look warp", str(step), (one,)) for step, one in ((1, worse), (2, tried))
    ]
    (found,) = tried_pages(steps)
    assert found.kind is LOOK
    assert [trial.value for step in found.steps for trial in step.trials] == pytest.approx(
        [110, 80]
    )
    atlas_look._base_tried.cache_clear()


def test_cameras_of_a_look_page_are_off_as_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(atlas_look, "SHEET", replace(DRAWN, cell_px=60, outline_px=1, views=4))
    true, off = (atlas_look.misturned(step, 2).train.frames for step in (0, 10))
    turns = [
        np.degrees(b.camera.angles[0] - a.camera.angles[0]) for a, b in zip(true, off, strict=True)
    ]
    turns = [(turn + 180) % 360 - 180 for turn in turns]
    assert np.abs(turns) == pytest.approx([10] * 4)
    assert sum(turns) == pytest.approx(0, abs=1e-6)
    assert len(atlas_look.numbered(5, 2).train.frames) == 5


def test_an_even_turn_does_not_flicker_and_a_pop_does() -> None:
    ramp = [np.full((4, 4, 3), value) for value in (0.2, 0.4, 0.2, 0.0)]
    assert flicker(ramp) == pytest.approx(0.2)
    assert flicker(ramp[:3]) == pytest.approx(0.4)  # up, down
    assert flicker(ramp[1:]) == pytest.approx(0)
