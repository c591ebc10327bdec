"""Landmark files: JSON and CSV, in pixels of sheet or view; what is broken is named."""

import json
from pathlib import Path

import numpy as np
import pytest

from toonset.calib.fit.landmarks import LandmarkFit, landmark_starts
from toonset.calib.outline.occluding_contour import prepare_surface
from toonset.dataset.mannequin.landmark_file import read_known_points, read_landmarks
from toonset.errors import LandmarkError
from toonset.mesh import Mesh
from toonset.view import View

KNOWN = {"nose": (0.0, 0.9, 0.1), "left_hand": (0.3, 0.5, 0.0), "right_hand": (-0.3, 0.5, 0.0)}
PIXELS = {"nose": [30.5, 20.0], "left_hand": [45.0, 60.25], "right_hand": [15.0, 60.0]}


def two_views() -> list[View]:
    rgba = np.full((100, 60, 4), 255, np.uint8)
    return [View(rgba, (10 + 100 * i, 5, 60, 100), 0.0, f"{i:03d}.png") for i in range(2)]


def in_sheet(view: View) -> dict[str, list[float]]:
    return {name: [u + view.box[0], v + view.box[1]] for name, (u, v) in PIXELS.items()}


def written(folder: Path, content) -> Path:
    path = folder / "marks.json"
    if isinstance(content, dict):
        content = json.dumps({"schema": "toonset-landmarks/1", **content})
    path.write_text(content, encoding="utf-8")
    return path


@pytest.mark.parametrize("key", ["1", "001", "001.png"])
def test_sheet_and_view_pixels_are_the_same_pairs(tmp_path, key):
    views = two_views()
    for content in (
        {"views": {key: in_sheet(views[1])}},
        {"views": {key: PIXELS}, "pixels": "view"},
        {"views": {key: [{"name": n, "pixel": p} for n, p in PIXELS.items()]}, "pixels": "view"},
    ):
        empty, found = read_landmarks(written(tmp_path, content), views, KNOWN)
        assert empty is None
        assert found is not None
        assert found.names == tuple(KNOWN)
        np.testing.assert_array_equal(found.pixels, list(PIXELS.values()))
        np.testing.assert_array_equal(found.world, list(KNOWN.values()))


def test_csv_with_and_without_coordinates(tmp_path):
    views = two_views()
    path = tmp_path / "marks.csv"
    rows = [f"000.png,{name},{u},{v}" for name, (u, v) in in_sheet(views[0]).items()]
    path.write_text("\ufeffview,name,u,v\r\n" + "\r\n".join(rows), encoding="utf-8")
    (found, _) = read_landmarks(path, views, KNOWN)
    assert found is not None
    np.testing.assert_array_equal(found.pixels, list(PIXELS.values()))
    rows = [f"0,,{20 + i},{30 + i},0.{i},0.5,0.1" for i in range(3)]
    path.write_text("view, name, u, v, x, y, z\n" + "\n".join(rows), encoding="utf-8")
    (found, _) = read_landmarks(path, views, {})
    assert found is not None
    np.testing.assert_array_equal(found.world[:, 0], [0.0, 0.1, 0.2])


def test_points_of_the_file_go_before_those_of_the_mannequin(tmp_path):
    views, mesh = two_views(), tmp_path / "body.obj"
    assert read_known_points(mesh) == {}
    sidecar = {"schema": "toonset-landmarks/1", "units": "world", "points": KNOWN}
    (tmp_path / "body.landmarks.json").write_text(json.dumps(sidecar))
    content = {"points": {"nose": [0, 1, 0.2]}, "views": {"0": PIXELS}, "pixels": "view"}
    found = read_landmarks(written(tmp_path, content), views, read_known_points(mesh))
    assert found[0] is not None
    np.testing.assert_array_equal(found[0].world[:2], [[0, 1, 0.2], KNOWN["left_hand"]])
    triangle = Mesh(np.array(list(KNOWN.values())), np.array([[0, 1, 2]]))
    first, second = landmark_starts(found, prepare_surface(triangle))
    assert isinstance(first, LandmarkFit)
    assert second is None
    assert len(first.poses) == 2  # three points lie in a plane


BROKEN = [
    ("{", "no valid JSON"),
    ("[" * 100_000, "no valid JSON"),
    ("[]", "no landmark file"),
    ('{"schema": "toonset-landmarks/9"}', "no landmark file"),
    ('{"schema": "toonset-landmarks/1", "views": {}, "views": {}}', "'views' is given twice"),
    ({"view": {}}, "unknown key 'view'; did you mean 'views'"),
    ({"views": []}, "must be objects"),
    ({"views": {}}, "holds no pairs"),
    ({"points": KNOWN}, "holds no pairs"),
    ({"views": {"0": PIXELS}, "pixels": "px"}, "\"pixels\" is 'px'"),
    ({"views": {"2": PIXELS}}, "no such view among 2; choose one of: 000.png, 001.png"),
    ({"views": {"02.png": PIXELS}}, "did you mean '00"),
    ({"views": {"0": {}, "1": {}}}, "holds no pairs"),
    ({"views": {"0": {"nose": [30, 20]}}}, "1 pairs, 3 are needed"),
    ({"views": {"0": PIXELS, "000": PIXELS}, "pixels": "view"}, "given twice, under two names"),
    ({"views": {"0": {**PIXELS, "noes": [30, 20]}}, "pixels": "view"}, "did you mean 'nose'"),
    ({"views": {"0": {**PIXELS, "nose": [30]}}}, r"nose: found \[30\], 2 finite numbers"),
    ({"views": {"0": {**PIXELS, "nose": [30, float("nan")]}}}, r"nose: found \[30, NaN\]"),
    ({"views": {"0": {**PIXELS, "nose": [30, 1e999]}}}, "2 finite numbers are needed"),
    ({"views": {"0": {**PIXELS, "nose": [True, 1]}}}, "2 finite numbers are needed"),
    ({"views": {"0": {**PIXELS, "nose": "12"}}}, "2 finite numbers are needed"),
    ({"views": {"0": {**PIXELS, "nose": [75, 20]}}, "pixels": "view"}, r"\(75, 20\) lies outside"),
    ({"views": {"1": in_sheet(two_views()[0])}}, "sheet pixels 110 to 170, 5 to 105"),
    ({"points": {"nose": [0, 1]}, "views": {}}, r"points: nose: found \[0, 1\], 3 finite"),
    ({"views": {"0": 7}}, "list of pairs is needed"),
    ({"views": {"0": [7]}}, "list of pairs is needed"),
    ({"views": {"0": [{"pixel": [1, 2]}]}}, 'pair 1 needs a "name"'),
    ({"views": {"0": [{"name": 3, "pixel": [1, 2]}]}}, 'pair 1 needs a "name"'),
    ({"views": {"0": [{"name": "nose", "pixels": [1, 2]}]}}, "did you mean 'pixel'"),
    ({"views": {"0": [{"name": "nose", "pixel": [1, 2]}] * 2}}, "'nose' is given twice"),
    ({"views": {"0": [{"name": str(i), "pixel": [1, 2]} for i in range(1001)]}}, "1001 pairs"),
]


@pytest.mark.parametrize(("content", "message"), BROKEN)
def test_broken_json_says_what_to_do(tmp_path, content, message):
    with pytest.raises(LandmarkError, match=message) as caught:
        read_landmarks(written(tmp_path, content), two_views(), KNOWN)
    assert str(caught.value).startswith(str(tmp_path / "marks.json"))
    assert "\n" not in str(caught.value)


def test_names_need_a_mannequin_with_names(tmp_path):
    path = written(tmp_path, {"views": {"0": PIXELS}, "pixels": "view"})
    with pytest.raises(LandmarkError, match='no named points; add "points" to the file'):
        read_landmarks(path, two_views(), {})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("view,name,x,y\n", "view,name,u,v"),
        ("view,name,u,v\n0,nose,1\n", ":2: has another number of cells"),
        ("view,name,u,v\n0,nose,1,2,3\n", ":2: has another number of cells"),
        ("view,name,u,v\n0,nose,1,\n", ":2: u, v"),
        ("view,name,u,v\n0,nose,1,inf\n", "2 finite numbers"),
        ("view,name,u,v,x,y,z\n0,nose,1,2,3,,\n", ":2: x, y, z"),
        ("view,name,u,v\n0,nose,20,30\n0,nose,20,30\n", "'nose' is given twice"),
        ("view,name,u,v\n", "holds no pairs"),
        ("\udc89PNG", "no UTF-8 text"),
        (None, "no such file"),
    ],
)
def test_broken_csv_says_where(tmp_path, text, message):
    path = tmp_path / "marks.csv"
    if text is not None:
        path.write_text(text, encoding="utf-8", errors="surrogateescape")
    with pytest.raises(LandmarkError, match=message):
        read_landmarks(path, two_views(), KNOWN)
