"""Views as tensors: those of the bundles, whatever they were packed into, in any worker."""

import json
import shutil
import tarfile
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.utils.data import ConcatDataset, DataLoader

import toonset as ts
from tests.apps.batch.test_pack import DONE, FORMATS, SHEETS, Make, pack
from toonset.dataset.images.picture import encode_png
from toonset.dataset.view_dataset import ViewItem
from toonset.errors import BundleError, ToonsetError, UsageError

POINTS = np.random.default_rng(3).normal([0.2, 1.0, 0.1], 0.2, (50, 3))
Item = ViewItem


def assert_same(one: Item, other: Item) -> None:
    """Compare two items; one of a batch has numbers as tensors."""
    assert one.keys() == other.keys()
    for name, value in one.items():
        theirs = other[name]  # type: ignore[literal-required]
        if isinstance(theirs, torch.Tensor):
            assert torch.equal(torch.as_tensor(value), theirs), name
        else:
            assert value == theirs, name


def check_item(item: Item, frame: object, *, labelled: bool) -> None:
    """Compare an item with a frame that `read_bundle` returns."""
    rgba = torch.cat([item["image"], item["alpha"]]).permute(1, 2, 0) * 255
    np.testing.assert_allclose(rgba, frame.rgba, atol=1e-4)  # type: ignore[attr-defined]
    assert item["image"].dtype == torch.float32
    labels = frame.labels if labelled else np.full(frame.rgba.shape[:2], 255)  # type: ignore[attr-defined]
    np.testing.assert_array_equal(item["labels"], labels)
    camera = frame.camera  # type: ignore[attr-defined]
    seen = camera.project(POINTS)[0]
    u, v, w = item["image_from_world"].numpy() @ np.column_stack([POINTS, np.ones(50)]).T
    np.testing.assert_allclose(np.stack([u / w, v / w], 1), seen, atol=1e-9)
    assert item["orthographic"] == camera.is_orthographic == bool((w == 1).all())
    local = (
        np.linalg.inv(item["world_from_camera"].numpy())[:3]
        @ np.column_stack([POINTS, np.ones(50)]).T
    )
    assert (local[2] > 0).all()  # z forward
    u, v, w = item["K"].numpy() @ local
    off = np.abs(np.stack([u / w, v / w], 1) - seen).max()
    assert off <= item["pinhole_error_px"] + 1e-6
    assert (item["pinhole_error_px"] > 0) == camera.is_orthographic
    assert tuple(item["size_wh"]) == camera.size_wh
    np.testing.assert_allclose(item["sigma"], np.radians([0.5] * 3))


@pytest.mark.parametrize("kind", FORMATS)
def test_a_data_set_holds_what_the_bundles_hold(
    kind: str, batch: Path, packed: dict[str, Path]
) -> None:
    views = ts.ViewDataset(packed[kind])
    sheets = sorted(DONE, key=lambda sheet: sheet.name)
    assert len(views) == 3 * len(sheets)
    names = [f"{sheet.name}/{n:03d}.png" for sheet in sheets for n in range(3)]
    assert [view["name"] for view in views] == names
    for number, sheet in enumerate(sheets):
        scene = ts.read_bundle(batch / "sheets" / sheet.name / "bundle").scene
        labelled = "palette" in sheet.stages
        for i, frame in enumerate(scene.frames):
            check_item(views[3 * number + i], frame, labelled=labelled)
            colors = views.palette(3 * number + i)
            assert colors.tolist() == (scene.palette.tolist() if labelled else [])  # type: ignore[union-attr]
    with pytest.raises(IndexError):
        views[len(views)]
    assert_same(views[-1], views[len(views) - 1])


def test_a_bundle_and_several(small_bundle: Path) -> None:
    views = ts.ViewDataset(ts.read_bundle(small_bundle))
    assert repr(views) == f"ViewDataset({str(small_bundle)!r}, 3 views)"
    for item, frame in zip(views, ts.read_bundle(small_bundle).scene.frames, strict=True):
        assert item["name"] == f"bundle/{frame.name}"
        check_item(item, frame, labelled=True)
    assert len(ConcatDataset([views, ts.ViewDataset(small_bundle / "transforms.json")])) == 6


def test_a_folder_of_another_program_has_no_sigmas_and_no_labels(
    small_bundle: Path, tmp_path: Path, toonset
) -> None:
    toonset("export", small_bundle, "--to", "nerfstudio", "-o", tmp_path / "ns", "-q")
    views = ts.ViewDataset(tmp_path / "ns")
    assert torch.isnan(views[0]["sigma"]).all()
    assert (views[0]["labels"] == 255).all()
    assert views.palette(0).shape == (0, 3)


@pytest.mark.parametrize("kind", FORMATS)
def test_workers_give_the_same(kind: str, packed: dict[str, Path]) -> None:
    views = ts.ViewDataset(packed[kind])
    loader = DataLoader(views, batch_size=None, num_workers=2, multiprocessing_context="fork")
    for one, other in zip(loader, views, strict=True):
        assert_same(one, other)


def test_new_processes_and_shuffled_batches(packed: dict[str, Path]) -> None:
    views = ts.ViewDataset(packed["parquet"], padded=True)
    loader = DataLoader(
        *(views, 5, True),
        num_workers=1,
        multiprocessing_context="spawn",
        generator=torch.Generator().manual_seed(0),
    )
    by_name = {item["name"]: item for item in views}
    seen = []
    for found in loader:
        assert found["image"].shape[1:] == (3, 24, 20)
        for i, name in enumerate(found["name"]):
            seen.append(name)
            assert_same({k: v[i] for k, v in found.items()}, by_name[name])  # type: ignore[arg-type]
    assert seen != sorted(seen)
    assert sorted(seen) == sorted(by_name)


def test_padding_is_empty_and_moves_nothing(bundle: Path) -> None:
    plain, padded = ts.ViewDataset(bundle), ts.ViewDataset(bundle, padded=True)
    sizes = {tuple(item["size_wh"].tolist()) for item in plain}
    assert len(sizes) > 1
    width, height = padded.largest_wh
    assert (width, height) == (max(w for w, _ in sizes), max(h for _, h in sizes))
    for one, other in zip(plain, padded, strict=True):
        w, h = one["size_wh"].tolist()
        assert other["image"].shape == (3, height, width)
        assert torch.equal(other["image"][:, :h, :w], one["image"])
        assert other["alpha"].count_nonzero() == one["alpha"].count_nonzero()
        assert (other["labels"] < 255).sum() == (one["labels"] < 255).sum()
        assert (other["labels"][h:] == 255).all()
        assert torch.equal(other["K"], one["K"])
        assert torch.equal(other["world_from_camera"], one["world_from_camera"])


def test_splits_are_named(make: Make, small_bundle: Path, tmp_path: Path) -> None:
    out = make(tmp_path / "out", SHEETS)
    done = pack(out, "--to", "folder", "--split", "40,0,60", "-o", tmp_path / "d", "--json", "-q")
    counts = done.json["splits"]
    assert set(counts) == {"train", "test"}
    for split, sheets in counts.items():
        assert len(ts.ViewDataset(tmp_path / "d", split=split)) == 3 * sheets
    with pytest.raises(UsageError, match="has the splits train, test; name one"):
        ts.ViewDataset(tmp_path / "d")
    with pytest.raises(UsageError, match="has no split 'val', but train, test"):
        ts.ViewDataset(tmp_path / "d", split="val")
    with pytest.raises(UsageError, match="a bundle has no splits"):
        ts.ViewDataset(small_bundle, split="train")


def read_all(folder: Path) -> None:
    list(ts.ViewDataset(folder))


@pytest.mark.parametrize("kind", FORMATS)
def test_damaged_data_sets_are_refused_with_their_file(
    kind: str, packed: dict[str, Path], tmp_path: Path
) -> None:
    folder = Path(shutil.copytree(packed[kind], tmp_path / kind))
    card = json.loads((folder / "card.json").read_text())
    name = card["splits"]["train"]["files"][0]["name"]
    file = folder / name / "metadata.jsonl" if kind == "folder" else folder / name
    whole = file.read_bytes()
    for data in (whole[: len(whole) // 3], whole[:530] + b"\xff" * 64 + whole[594:], b"{}", b""):
        file.write_bytes(data)
        with pytest.raises(ToonsetError) as refused:
            read_all(folder)
        assert file.name in str(refused.value)
        assert str(refused.value).isprintable()
    file.write_bytes(whole)
    opened = ts.ViewDataset(folder)
    file.unlink()
    if kind != "folder":  # its pictures are files of their own
        with pytest.raises(BundleError, match=file.name):
            opened[0]
    with pytest.raises(BundleError, match=file.name):
        read_all(folder)
    card["splits"]["train"]["files"][0]["name"] = "../../elsewhere.tar"
    (folder / "card.json").write_text(json.dumps(card))
    with pytest.raises(BundleError, match="out of the folder"):
        ts.ViewDataset(folder)
    (folder / "card.json").write_text('{"format": "webdataset"}')
    with pytest.raises(BundleError, match="states no schema"):
        ts.ViewDataset(folder)


def test_pictures_that_do_not_belong_to_their_cameras(
    packed: dict[str, Path], tmp_path: Path
) -> None:
    folder = Path(shutil.copytree(packed["folder"], tmp_path / "d"))
    picture = folder / "train" / "knight-1" / "images" / "000.png"
    kept = picture.read_bytes()
    picture.write_bytes(encode_png(np.zeros((8, 9, 4), np.uint8)))
    views = ts.ViewDataset(folder)
    with pytest.raises(BundleError, match="is 9 x 8 px, its camera says 20 x 24"):
        views[0]
    picture.unlink()
    with pytest.raises(BundleError, match="no such file"):
        views[0]
    picture.write_bytes(kept)
    labels = folder / "train" / "knight-1" / "labels" / "000.png"
    lines = (folder / "train" / "metadata.jsonl").read_text().splitlines()
    first = json.loads(lines[0])
    first["palette"] = first["palette"][:1]
    metadata = folder / "train" / "metadata.jsonl"
    metadata.write_text("\n".join([json.dumps(first), *lines[1:]]))
    with pytest.raises(BundleError, match=r"labels/000.png: label 1 but the palette has 1 col"):
        ts.ViewDataset(folder)[0]
    first["camera"]["scale"] *= 2
    metadata.write_text("\n".join([json.dumps(first), *lines[1:]]))
    with pytest.raises(BundleError, match=r"metadata.jsonl: line 1: .*disagree"):
        ts.ViewDataset(folder)
    first["file_name"] = "../../../secret.png"
    metadata.write_text(json.dumps(first))
    with pytest.raises(BundleError, match="out of the folder"):
        ts.ViewDataset(folder)
    assert labels.is_file()


def test_links_in_a_tar_file_lead_nowhere(packed: dict[str, Path], tmp_path: Path) -> None:
    folder = Path(shutil.copytree(packed["webdataset"], tmp_path / "d"))
    info = tarfile.TarInfo("a-000.png")
    info.type, info.linkname = tarfile.SYMTYPE, "card.json"
    with tarfile.open(folder / "train-000000.tar", "w") as tar:
        tar.addfile(info)
    with pytest.raises(BundleError, match=r"'a-000.png' is no file of a view"):
        ts.ViewDataset(folder)
