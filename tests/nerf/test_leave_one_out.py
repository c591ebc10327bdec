"""Leaving every drawing out: nothing of it reaches its prediction, and figures are those of it."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

import toonset as ts
from tests.nerf.ellipsoids import scene_of
from tests.test_notebook import Page
from toonset.dataset.bundle.camera_record import NativeCamera
from toonset.dataset.bundle.scene import Scene
from toonset.errors import BundleError, UsageError
from toonset.nerf.leave_one_out import LeaveOneOut
from toonset.nerf.score.evaluate import chosen_frames
from toonset.nerf.score.metrics import compare

QUICK = ts.TrainOptions(steps=8, device="cpu", seed=3, register=False, unwarp=False)
YAWS = np.radians([0, 60, 120, 200, 280]).tolist()
LEFT_OUT = ["001.png", "003.png"]


@pytest.fixture(scope="module")
def scene() -> Scene:
    return scene_of(YAWS, 0.1, 0.0)


@pytest.fixture(scope="module")
def found(scene: Scene) -> LeaveOneOut:
    return ts.leave_one_out(scene, QUICK, views=LEFT_OUT[::-1], threads=1)


def test_each_view_is_predicted_by_the_others_alone(scene: Scene, found: LeaveOneOut) -> None:
    assert [view.name for view in found.views] == LEFT_OUT  # in the scene's order
    assert found.trained_on[0] == ("000.png", "002.png", "003.png", "004.png")
    rest = chosen_frames(scene, {"scene": {"views": list(found.trained_on[0])}})
    field = ts.train(rest, QUICK, threads=1).field
    for layer, picture in found.views[0].pictures.items():
        rendering = ts.render(field, scene.frames[1].camera)
        np.testing.assert_array_equal(rendering.picture(layer), picture)
        plain = compare(picture, scene.frames[1].rgba)
        assert plain.items() <= found.views[0].figures[layer].items()


def test_nothing_of_a_drawing_reaches_its_prediction(scene: Scene, found: LeaveOneOut) -> None:
    rng = np.random.default_rng(0)
    spoiled = rng.integers(0, 256, scene.frames[3].rgba.shape).astype(np.uint8)
    frames = (*scene.frames[:3], replace(scene.frames[3], rgba=spoiled), scene.frames[4])
    other = ts.leave_one_out(replace(scene, frames=frames), QUICK, views=LEFT_OUT[1:], threads=1)
    for layer, picture in found.views[1].pictures.items():
        np.testing.assert_array_equal(other.views[0].pictures[layer], picture)
    assert other.mean["drawn"]["psnr"] != found.views[1].figures["drawn"]["psnr"]


def test_means_and_json(scene: Scene, found: LeaveOneOut) -> None:
    content = json.loads(json.dumps(found.to_json(), allow_nan=False))
    for layer, means in found.mean.items():
        each = [view.figures[layer]["psnr"] for view in found.views]
        assert content[layer] == means
        assert means["psnr"] == pytest.approx(np.mean(np.array(each, float)))
        assert {"ssim", "flip", "silhouette_iou", "ink_f1", "label_miou"} <= means.keys()
    said = content["leave_one_out"]
    assert (said["options"]["seed"], said["options"]["steps"]) == (3, 8)
    for view, camera in zip(said["views"], found.cameras, strict=True):
        assert NativeCamera(**view["camera"]).camera().angles == camera.angles
        assert view["steps"] == 8
    missing = replace(found.views[0], figures={"rgb": found.views[0].figures["rgb"]})
    partly = replace(found, views=(missing, found.views[1]))
    assert partly.to_json()["drawn"] is None  # of one view of two: no mean of the protocol
    assert partly.to_json()["rgb"] == found.mean["rgb"]


def test_a_notebook_shows_every_view_beside_its_prediction(found: LeaveOneOut) -> None:
    page = Page(found._repr_html_())
    assert page.tags.count("img") == 2 * len(found.views)
    assert "seed 3" in page.words
    assert f"{found.mean['drawn']['psnr']:.2f}" in page.words


@pytest.mark.parametrize(
    ("views", "reason"),
    [
        (["01.png"], "views: '01.png' is no drawing with a figure; did you mean '001.png'?"),
        (["side"], "choose of 000.png, 001.png, 002.png, 003.png, 004.png"),
        (["001.png", "001.png"], "named twice"),
        ("001.png", "give a list of names"),
        ([], "give a list of names"),
    ],
)
def test_views_that_are_not_there(scene: Scene, views: list[str], reason: str) -> None:
    with pytest.raises(UsageError) as refused:
        ts.leave_one_out(scene, QUICK, views=views)
    assert reason in str(refused.value)


def test_too_few_drawings_and_options_out_of_range(scene: Scene) -> None:
    empty = replace(scene.frames[2], rgba=np.zeros_like(scene.frames[2].rgba))
    with pytest.raises(BundleError, match="2 drawings show a figure, 3 are needed"):
        ts.leave_one_out(replace(scene, frames=(*scene.frames[:2], empty)), QUICK)
    with pytest.raises(UsageError, match="steps"):
        ts.leave_one_out(scene, ts.TrainOptions(steps=0))


class Heard:
    """A listener that keeps what it is told."""

    def __init__(self) -> None:
        self.said: list[str] = []

    def say(self, text: str) -> None:
        self.said.append(text)

    detail = progress = say


def test_a_listener_hears_of_which_view_and_the_host_is_left_as_it_was(scene: Scene) -> None:
    heard, before = Heard(), (torch.get_num_threads(), torch.get_rng_state())
    few = replace(scene, frames=scene.frames[::2])
    ts.leave_one_out(few, QUICK, views=["002.png"], palette=False, threads=1, listener=heard)
    assert heard.said
    assert all(line.startswith("002.png left out (1 of 1): ") for line in heard.said)
    assert torch.get_num_threads() == before[0]
    assert torch.equal(torch.get_rng_state(), before[1])
