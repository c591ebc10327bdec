"""COLMAP models as people and scripts write them: the same cameras, or a refusal."""

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pycolmap
import pytest

from tests.dataset.exporters.exported_views import TARGET, around
from tests.dataset.importers.imported_views import views_all_round
from toonset.camera import Camera
from toonset.dataset.exporters.colmap import write_colmap
from toonset.dataset.importers.colmap import read_colmap
from toonset.dataset.importers.colmap_text import lines_with_points
from toonset.dataset.importers.detect import read_import
from toonset.errors import BundleError

Edit = Callable[[str], str]
LENSES = {  # of a model: focal lengths that it has, coefficients behind the principal point
    "SIMPLE_RADIAL": (1, 1),
    "RADIAL": (1, 2),
    "OPENCV": (2, 4),
    "FULL_OPENCV": (2, 8),
    "SIMPLE_PINHOLE": (1, 0),
}


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    write_colmap(tmp_path / "out", views_all_round(k=0.2), text=True, old_layout=True)
    (tmp_path / "out" / "toonset.json").unlink()
    return tmp_path / "out"


def edit(dataset: Path, name: str, change: Edit) -> None:
    file = dataset / "sparse" / "0" / f"{name}.txt"
    file.write_bytes(change(file.read_text()).encode())


def off_px(dataset: Path) -> float:
    """Return how far the cameras are off those that were written; all four must be there."""
    points = around(TARGET)
    found: list[Camera] = [camera for _, camera in read_colmap(dataset)]
    pairs = zip(found, views_all_round(k=0.2), strict=True)
    return max(
        float(np.abs(one.project(points)[0] - view.pinhole.project(points)[0]).max())
        for one, view in pairs
    )


def lens(model: str, coefficients: list[str]) -> Edit:
    focals, _ = LENSES[model]

    def change(text: str) -> str:
        lines = [line.split() for line in text.splitlines() if line[0] != "#"]
        return "".join(
            " ".join([w[0], model, *w[2:4], *w[4 : 4 + focals], *w[6:8], *coefficients]) + "\n"
            for w in lines
        )

    return change


@pytest.mark.parametrize("binary", [False, True], ids=["text", "binary"])
@pytest.mark.parametrize("model", LENSES)
def test_a_lens_that_bends_nothing_is_a_pinhole(dataset: Path, model: str, binary: bool) -> None:
    edit(dataset, "cameras", lens(model, ["0"] * LENSES[model][1]))
    if binary:
        sparse = dataset / "sparse" / "0"
        read = pycolmap.Reconstruction(sparse)
        shutil.rmtree(sparse)
        sparse.mkdir()
        read.write_binary(sparse)
    assert off_px(dataset) < 0.01


def test_a_lens_that_bends_is_refused(dataset: Path) -> None:
    edit(dataset, "cameras", lens("OPENCV", ["0.01", "0", "0", "0"]))
    with pytest.raises(BundleError, match=r"has a OPENCV camera, .*; undistort the images"):
        read_colmap(dataset)


def scaled(factor: float, decimals: int = 17) -> Edit:
    def line(words: list[str]) -> str:
        if len(words) == 10 and words[0] != "#":
            words[1:5] = [f"{factor * float(word):.{decimals}f}" for word in words[1:5]]
        return " ".join(words)

    return lambda text: "".join(line(one.split()) + "\n" for one in text.splitlines())


@pytest.mark.parametrize("factor", [2.0, -0.5, 1e-3])
def test_a_quaternion_may_have_any_length(dataset: Path, factor: float) -> None:
    edit(dataset, "images", scaled(factor))
    assert off_px(dataset) < 0.01


def test_a_rounded_quaternion_is_a_rotation(dataset: Path) -> None:
    edit(dataset, "images", scaled(1.0, 4))
    assert off_px(dataset) < 0.1


def test_a_quaternion_of_zeros_is_refused(dataset: Path) -> None:
    edit(dataset, "images", scaled(0.0))
    with pytest.raises(BundleError, match="quaternion is 0"):
        read_colmap(dataset)


NO_BLANKS: dict[str, Edit] = {
    "none": lambda text: text.replace("\n\n", "\n"),
    "none, no end of line": lambda text: text.replace("\n\n", "\n").rstrip(),
    "none, Windows": lambda text: text.replace("\n\n", "\n").replace("\n", "\r\n"),
    "one missing": lambda text: text.replace("\n\n", "\n", 1),
    "the last missing": lambda text: text.rstrip() + "\n",
    "spaces": lambda text: text.replace("\n\n", "\n  \n"),
}


@pytest.mark.parametrize("kind", NO_BLANKS)
def test_images_without_empty_lines_are_all_read(dataset: Path, kind: str) -> None:
    edit(dataset, "images", NO_BLANKS[kind])
    assert off_px(dataset) < 0.01


def test_lines_of_points_stay_what_they_are() -> None:
    pose, points = "7 1 0 0 0 0 0 0 1 a picture.png", "1.5 2 -1 3 4 17 5 6 7 8 9 10"
    assert lines_with_points([pose, points, pose, ""]) == [pose, points, pose, ""]
    assert lines_with_points(["# head", pose, pose]) == ["# head", pose, "", pose, ""]
    assert lines_with_points([pose, points, pose]) == [pose, points, pose, ""]


def test_pictures_without_a_camera_are_said(dataset: Path) -> None:
    edit(dataset, "images", lambda text: "\n".join(re.split(r"\n(?=[34] )", text)[:1]) + "\n")
    (line,) = read_import(dataset).remarks
    assert line.startswith("left out, for they have no camera: 002.png, 003.png (2 of ")


def test_names_with_backslashes_are_found(dataset: Path) -> None:
    (dataset / "images" / "cel").mkdir()
    for file in list((dataset / "images").glob("*.png")):
        file.rename(dataset / "images" / "cel" / file.name)
    edit(dataset, "images", lambda text: re.sub(r" (\d+\.png)", r" cel\\\1", text))
    assert [view.name for view in read_import(dataset).views] == [f"00{i}.png" for i in range(4)]
