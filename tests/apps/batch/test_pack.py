"""`toonset pack`: what is read back is what the bundles hold, whatever the format and the order."""

import hashlib
import io
import itertools
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.conftest import Outcome, contents, run_here
from toonset.apps.batch import pack as verb
from toonset.apps.batch.rows import Plan, StageRow
from toonset.apps.batch.stages import Entry
from toonset.apps.batch.table import Table
from toonset.apps.batch.table_file import TABLE
from toonset.dataset.bundle.bundle import read_bundle
from toonset.dataset.images.picture import encode_png

FORMATS = ("webdataset", "parquet", "folder")
KEYS = {"calibrate": "a", "palette": "b"}


@dataclass(frozen=True)
class Sheet:
    """A sheet of a batch that nobody had to run."""

    name: str
    character: str = ""
    verdict: str = "ok"
    license: str = ""
    state: str = "done"
    stages: tuple[str, ...] = tuple(KEYS)


SHEETS = (
    Sheet("knight-1", "Sir Knight", license="CC0-1.0"),
    Sheet("knight-2", "Sir Knight", "weak", license="CC0-1.0"),
    Sheet("mage", "Mage | *of* `fire`", "ambiguous"),
    Sheet("élan", stages=("calibrate",)),
    Sheet("torn", state="failed"),
)
DONE = [sheet for sheet in SHEETS if sheet.state == "done"]

Make = Callable[[Path, Sequence[Sheet]], Path]


def pack(*arguments: object) -> Outcome:
    """Run `toonset pack`."""
    return run_here("pack", *arguments)


@pytest.fixture(scope="module")
def make(small_bundle: Path) -> Make:
    """Return a function that makes a batch of sheets in a folder."""

    def batch(out: Path, sheets: Sequence[Sheet]) -> Path:
        out.mkdir()
        plans = []
        for position, sheet in enumerate(sheets):
            if sheet.state == "done":
                fill(out / "sheets" / sheet.name / "bundle", small_bundle, sheet)
            entry = Entry(
                *(sheet.name, ("s.png",), {}, sheet.character or sheet.name, sheet.license),
                source="https://example.org/a",
            )
            plans.append(Plan(entry, position, {stage: KEYS[stage] for stage in sheet.stages}))
        with closing(Table(out / TABLE, make=True)) as table:
            table.plan(plans, lambda name: set(KEYS))
            table.choose(sheet.name for sheet in sheets)
            state = {sheet.name: sheet for sheet in sheets}
            while (row := table.claim("me", 60)) is not None:
                sheet = state[row.name]
                rows = [StageRow(stage, KEYS[stage], sheet.state) for stage in sheet.stages]  # type: ignore[arg-type]
                table.record("me", row.name, rows)
        return out

    return batch


def fill(bundle: Path, small: Path, sheet: Sheet) -> None:
    """Make a bundle with a verdict, and with a picture that no other sheet has."""
    shutil.copytree(small, bundle)
    calibration = json.loads((bundle / "calibration.json").read_text())
    calibration["verdict"] = sheet.verdict
    (bundle / "calibration.json").write_text(json.dumps(calibration))
    picture = bundle / "images" / "000.png"
    rgba = np.array(Image.open(picture))
    rgba[5, 6, :3] = np.frombuffer(hashlib.sha256(sheet.name.encode()).digest()[:3], np.uint8)
    picture.write_bytes(encode_png(rgba))


@pytest.fixture(scope="module")
def batch(make: Make, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a batch; read only."""
    return make(tmp_path_factory.mktemp("batches") / "out", SHEETS)


@pytest.fixture(scope="module")
def packed(batch: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return that batch as a data set of every format."""
    root = tmp_path_factory.mktemp("packed")
    for kind in FORMATS:
        done = pack(batch, "--to", kind, "-o", root / kind, "--quiet")
        assert (done.code, done.err) == (0, ""), done
    return {kind: root / kind for kind in FORMATS}


def samples(folder: Path) -> list[dict[str, Any]]:
    """Return the views of a data set as WebDataset reads them."""
    from webdataset.compat import WebDataset

    shards = [str(path) for path in sorted(folder.glob("*.tar"))]
    return list(WebDataset(shards, shardshuffle=False, empty_check=False))


def pixels(file: Path) -> np.ndarray:
    """Return a picture as it is stored: of an indexed one the labels."""
    with Image.open(file) as picture:
        return np.array(picture)


def check_values(values: dict[str, Any], sheet: Sheet, number: int, bundle: Path) -> None:
    """Compare a view's values with the files of its bundle."""
    frame = json.loads((bundle / "transforms.json").read_text())["frames"][number]
    view = json.loads((bundle / "calibration.json").read_text())["views"][number]
    said = json.loads((bundle / "palette.json").read_text())["colors"]
    assert values["camera"] == frame["toonset"]
    for name in ("transform_matrix", "fl_x", "fl_y", "cx", "cy", "w", "h"):
        assert values[name] == frame[name], name
    for name in ("yaw_deg", "elevation_deg", "roll_deg"):
        assert values[name] == view["camera"][name]
        assert values[f"sigma_{name}"] == view["sigma"][name]
    assert values["p_flip"] == view["p_flip"]
    assert (values["view_verdict"], values["view_reason"]) == (view["verdict"], view["reason"])
    assert (values["view"], values["views"]) == (number, 3)
    assert values["verdict"] == sheet.verdict
    assert values["character"] == (sheet.character or sheet.name)
    assert values["license"] == (sheet.license or "unknown")
    assert values["source"] == "https://example.org/a"
    assert values["toonset"] == "0.1.0"
    colors = said if "palette" in sheet.stages else []
    assert values["palette"] == [{n: one[n] for n in ("hex", "share", "name")} for one in colors]


def expected(batch: Path) -> list[tuple[Sheet, int, Path]]:
    """Return every view that is to be packed, in order: sheet, number, bundle."""
    sheets = sorted(DONE, key=lambda sheet: sheet.name)
    return [(s, n, batch / "sheets" / s.name / "bundle") for s in sheets for n in range(3)]


def test_webdataset_has_every_view_as_the_bundle_has_it(
    batch: Path, packed: dict[str, Path]
) -> None:
    found, wanted = samples(packed["webdataset"]), expected(batch)
    assert [view["__key__"] for view in found] == [f"{s.name}-{n:03d}" for s, n, _ in wanted]
    for view, (sheet, number, bundle) in zip(found, wanted, strict=True):
        check_values(json.loads(view["json"]), sheet, number, bundle)
        assert view["png"] == (bundle / "images" / f"{number:03d}.png").read_bytes()
        assert ("labels.png" in view) == ("palette" in sheet.stages)
        if "labels.png" in view:
            assert view["labels.png"] == (bundle / "labels" / f"{number:03d}.png").read_bytes()


def test_results_behind_a_url_are_packed_alike(
    make: Make, packed: dict[str, Path], tmp_path: Path
) -> None:
    out, store = make(tmp_path / "out", SHEETS), tmp_path / "store"
    (out / "sheets").rename(store)
    run = store / "knight-1" / "bundle" / "run"
    run.mkdir()
    os.mkfifo(run / "never-read")  # a field is not packed: nor is it fetched
    with closing(Table(out / TABLE)) as table:
        table.store = f"file://{store}"
    done = pack(out, "--to", "webdataset", "-o", tmp_path / "packed")
    assert done.code == 0, done
    assert contents(tmp_path / "packed") == contents(packed["webdataset"])


def test_what_is_wrong_behind_a_url_is_told_with_the_url(make: Make, tmp_path: Path) -> None:
    out, store = make(tmp_path / "out", SHEETS[:1]), tmp_path / "store"
    (out / "sheets").rename(store)
    with closing(Table(out / TABLE)) as table:
        table.store = f"file://{store}"
    (store / "knight-1" / "bundle" / "images" / "000.png").write_bytes(b"torn")
    done = pack(out, "--to", "webdataset", "-o", tmp_path / "packed")
    assert (done.code, done.err.count("\n")) == (2, 1), done
    assert f"file://{store}/knight-1/bundle/images/000.png" in done.err
    shutil.rmtree(store / "knight-1" / "bundle")
    done = pack(out, "--to", "webdataset", "-o", tmp_path / "packed")
    assert (done.code, done.err.count("\n")) == (2, 1), done
    assert f"file://{store}/knight-1/bundle" in done.err


def test_parquet_has_every_view_as_the_bundle_has_it(batch: Path, packed: dict[str, Path]) -> None:
    from pyarrow import parquet

    rows = parquet.read_table(packed["parquet"] / "train-000000.parquet").to_pylist()
    for row, (sheet, number, bundle) in zip(rows, expected(batch), strict=True):
        check_values(row, sheet, number, bundle)
        assert row["image"]["bytes"] == (bundle / "images" / f"{number:03d}.png").read_bytes()
        labels = (bundle / "labels" / f"{number:03d}.png").read_bytes()
        assert row["labels"] is None or row["labels"]["bytes"] == labels
        assert (row["labels"] is not None) == ("palette" in sheet.stages)


def test_folders_are_scenes_and_listed(batch: Path, packed: dict[str, Path]) -> None:
    train = packed["folder"] / "train"
    lines = [json.loads(line) for line in (train / "metadata.jsonl").read_text().splitlines()]
    for line, (sheet, number, bundle) in zip(lines, expected(batch), strict=True):
        check_values(line, sheet, number, bundle)
        picture = (train / line["file_name"]).read_bytes()
        assert picture == (bundle / "images" / f"{number:03d}.png").read_bytes()
        ours, theirs = read_bundle(train / sheet.name), read_bundle(bundle)
        for one, other in zip(ours.scene.frames, theirs.scene.frames, strict=True):
            assert np.array_equal(one.rgba, other.rgba)
            assert np.array_equal(one.camera.rotation, other.camera.rotation)
            assert one.camera.scale == other.camera.scale
            if "palette" in sheet.stages:
                assert one.labels is not None
                assert np.array_equal(one.labels, other.labels)  # type: ignore[arg-type]


def test_both_cameras_are_as_the_card_says(batch: Path, packed: dict[str, Path]) -> None:
    points = np.random.default_rng(3).normal([0.2, 1.0, 0.1], 0.3, (50, 3))
    for view, (_, number, bundle) in zip(
        samples(packed["webdataset"]), expected(batch), strict=True
    ):
        values = json.loads(view["json"])
        camera, truth = values["camera"], read_bundle(bundle).scene.frames[number].camera
        x, y, z = np.array(camera["rotation"]) @ (points - camera["target"]).T
        u = camera["center"][0] + camera["scale"] * x / (1 + camera["k"] * z)
        v = camera["center"][1] + camera["scale"] * camera["pixel_aspect"] * y / (
            1 + camera["k"] * z
        )
        assert np.allclose(np.stack([u, v], 1), truth.project(points)[0], 0, 1e-9)
        pose = np.linalg.inv(values["transform_matrix"])  # OpenGL: x right, y up, z back
        x, y, z = pose[:3, :3] @ points.T + pose[:3, 3:]
        far = np.stack(
            [values["cx"] - values["fl_x"] * x / z, values["cy"] + values["fl_y"] * y / z]
        )
        assert np.abs(far - [u, v]).max() <= camera["pinhole_error_px"] + 1e-6
        yaw, elevation, roll = np.radians(
            [values[f"{n}_deg"] for n in ("yaw", "elevation", "roll")]
        )
        assert np.allclose(truth.angles, (yaw, elevation, roll))


def test_datasets_reads_all_formats(
    batch: Path, packed: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    datasets = pytest.importorskip("datasets")
    wanted = expected(batch)
    for kind, folder in packed.items():
        found = list(
            datasets.load_dataset(str(folder), split="train", cache_dir=str(tmp_path / kind))
        )
        assert len(found) == len(wanted)
        for view, (sheet, number, bundle) in zip(found, wanted, strict=True):
            values = view["json"] if kind == "webdataset" else view
            image = view["png" if kind == "webdataset" else "image"]
            labels = view.get("labels.png" if kind == "webdataset" else "labels")
            assert (
                values["camera"]["rotation"][0][0]
                == json.loads((bundle / "transforms.json").read_text())["frames"][number][
                    "toonset"
                ]["rotation"][0][0]
            )
            assert np.array_equal(image, pixels(bundle / "images" / f"{number:03d}.png"))
            assert (labels is not None) == ("palette" in sheet.stages)
            if labels is not None:
                assert np.array_equal(labels, pixels(bundle / "labels" / f"{number:03d}.png"))


def test_parquet_features_are_those_that_datasets_writes(packed: dict[str, Path]) -> None:
    from datasets import Features, Image
    from pyarrow import parquet

    schema = parquet.read_schema(packed["parquet"] / "train-000000.parquet")
    features = Features.from_arrow_schema(schema)
    assert isinstance(features["image"], Image)
    assert features.arrow_schema.remove_metadata() == schema.remove_metadata()


@pytest.mark.parametrize("kind", FORMATS)
def test_what_the_card_says_of_loading_runs(
    packed: dict[str, Path], kind: str, tmp_path: Path
) -> None:
    text = (packed[kind] / "README.md").read_text()
    (script,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    (call,) = re.findall(r"load_dataset(\(.*split=\"train\"\))", text)
    asked = f"from datasets import load_dataset\nprint(len(load_dataset{call}))\n"
    offline = os.environ | {"HF_HUB_OFFLINE": "1", "HF_DATASETS_CACHE": str(tmp_path)}
    command = [sys.executable, "-c", script + asked]
    done = subprocess.run(command, cwd=packed[kind], env=offline, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    *lines, count = done.stdout.splitlines()
    assert len(lines) == (3 if kind == "folder" else 12)
    assert count == "12"


@pytest.mark.parametrize("kind", FORMATS)
def test_the_same_sheets_give_the_same_bytes_in_any_order(
    make: Make, packed: dict[str, Path], kind: str, tmp_path: Path
) -> None:
    backwards = make(tmp_path / "backwards", SHEETS[::-1])
    assert pack(backwards, "--to", kind, "-o", tmp_path / "again").code == 0
    assert contents(tmp_path / "again") == contents(packed[kind])


def test_tar_files_say_nothing_of_who_wrote_them_or_when(packed: dict[str, Path]) -> None:
    with tarfile.open(packed["webdataset"] / "train-000000.tar") as tar:
        for member in tar:
            assert (member.mtime, member.uid, member.gid, member.uname) == (0, 0, 0, "")


def test_a_sheet_is_whole_in_one_shard_and_shards_are_no_larger_than_told(
    make: Make, tmp_path: Path
) -> None:
    out = make(tmp_path / "out", [Sheet(f"s{number:02d}") for number in range(12)])
    for file in (out / "sheets").rglob("images/*.png"):  # incompressible
        noise = np.random.default_rng(0).bytes(76_000)
        file.write_bytes(file.read_bytes()[:-12] + chunk(b"abCd", noise) + file.read_bytes()[-12:])
    for kind, end in (("webdataset", "tar"), ("parquet", "parquet")):
        place = tmp_path / kind
        assert pack(out, "--to", kind, "-o", place, "--shard-size", 1).code == 0
        shards = sorted(place.glob(f"train-*.{end}"))
        assert [shard.name for shard in shards] == [f"train-{n:06d}.{end}" for n in range(3)]
        assert max(shard.stat().st_size for shard in shards) <= 10**6
        card = json.loads((place / "card.json").read_text())
        files = card["splits"]["train"]["files"]
        assert [file["bytes"] for file in files] == [shard.stat().st_size for shard in shards]
        assert [file["sheets"] for file in files] == [4, 4, 4]
    of_shard: dict[str, list[str]] = {}
    for view in samples(tmp_path / "webdataset"):
        of_shard.setdefault(view["__url__"], []).append(json.loads(view["json"])["sheet"])
    groups = [name for names in of_shard.values() for name, _ in itertools.groupby(names)]
    assert groups == [f"s{number:02d}" for number in range(12)]


def chunk(name: bytes, data: bytes) -> bytes:
    """Return a chunk of a PNG that readers skip."""
    import zlib

    length, check = len(data).to_bytes(4, "big"), zlib.crc32(name + data).to_bytes(4, "big")
    return length + name + data + check


def test_characters_keep_their_split_when_others_come(make: Make, tmp_path: Path) -> None:
    few = [Sheet(f"s{number}", f"character {number // 2}") for number in range(20)]
    more = [Sheet(f"a{number}", f"character {number}") for number in range(14)]
    found = []
    for name, sheets in (("few", few), ("more", [*more, *few])):
        out = make(tmp_path / name, sheets)
        done = pack(out, "--to", "webdataset", "-o", tmp_path / f"{name}-set", "--split", "6,2,2")
        assert done.code == 0
        split_of: dict[str, str] = {}
        for view in samples(tmp_path / f"{name}-set"):
            split = Path(view["__url__"]).name.split("-")[0]
            character = json.loads(view["json"])["character"]
            assert split_of.setdefault(character, split) == split
        found.append(split_of)
    assert set(found[0].values()) == {"train", "val", "test"}
    assert found[0].items() <= found[1].items()


def test_splits_have_their_shares() -> None:
    names = [verb.split_of(f"character {number}", (80, 10, 10)) for number in range(4000)]
    for name, share in (("train", 0.8), ("val", 0.1), ("test", 0.1)):
        spread = (share * (1 - share) / 4000) ** 0.5
        assert abs(names.count(name) / 4000 - share) < 5 * spread
    assert {verb.split_of(str(number), (0, 0, 1)) for number in range(500)} == {"test"}
    assert verb.split_of("Zoë", (1, 1, 1)) == verb.split_of("zoe\u0308", (1, 1, 1))


def test_card_counts_what_is_there(packed: dict[str, Path]) -> None:
    card = json.loads((packed["webdataset"] / "card.json").read_text())
    assert (card["sheets"], card["views"], card["characters"]) == (4, 12, 3)
    assert "Some sheets have no labels" in (packed["webdataset"] / "README.md").read_text()
    assert card["verdicts"] == {"ambiguous": 1, "ok": 2, "weak": 1}
    assert card["licenses"] == {"CC0-1.0": 2, "unknown": 2}
    assert card["camera_models"] == {"orthographic": 8, "pinhole": 4}
    assert card["sheets_with_labels"] == 3
    yaws = [json.loads(view["json"])["yaw_deg"] for view in samples(packed["webdataset"])]
    for at, count in card["yaw_deg"].items():
        near = [abs((yaw - int(at) + 180) % 360 - 180) < 7.5 for yaw in yaws]
        assert count == sum(near), at
    assert sum(card["elevation_deg"].values()) == 12
    assert len(card["yaw_deg"]) == 24


def test_foreign_text_is_text_in_the_card(make: Make, tmp_path: Path) -> None:
    out = make(tmp_path / "out", [Sheet("s", license="<b>mine</b> | [x](y)\n---\nevil: 1")])
    pack(out, "--to", "webdataset", "-o", tmp_path / "set")
    text = (tmp_path / "set" / "README.md").read_text()
    assert "<b>" not in text
    assert "](y)" not in text
    assert "1 hand-drawn character sheet of 1 character, " in text
    _, front, rest = text.split("---\n", 2)
    assert "evil" not in front
    assert "license: other" in front
    assert r"| \<b\>mine\</b\> \| \[x\]\(y\) --- evil: 1 | 1 |" in rest


@pytest.mark.parametrize(
    ("options", "names"),
    [
        (("--verdict", "ok"), {"knight-1", "élan"}),
        (("--verdict", "weak", "--verdict", "ambiguous"), {"knight-2", "mage"}),
    ],
)
def test_only_verdicts_that_are_asked_for(
    batch: Path, tmp_path: Path, options: tuple[str, ...], names: set[str]
) -> None:
    done = pack(batch, "--to", "webdataset", "-o", tmp_path / "set", *options, "--json")
    assert done.json["sheets"] == 2
    assert "left out: " in done.err
    assert "2 of another verdict" in done.err
    assert "1 failed" in done.err
    assert {json.loads(view["json"])["sheet"] for view in samples(tmp_path / "set")} == names


def test_a_verdict_that_a_person_corrected_counts(make: Make, tmp_path: Path) -> None:
    out = make(tmp_path / "out", [Sheet("s", verdict="weak")])
    words = ("--to", "folder", "--verdict", "ok", "-o", tmp_path / "set")
    assert "1 of another verdict" in pack(out, *words).reason
    file = out / "sheets/s/bundle/calibration.json"
    file.write_text(file.read_text().replace('"verdict": "weak"', '"verdict": "ok"'))
    assert pack(out, *words).code == 0


def cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-20])


def leads_out(file: Path) -> None:
    moved = shutil.move(file, file.parents[5] / file.name)
    file.symlink_to(moved)


def as_jpeg(file: Path) -> None:
    buffer = io.BytesIO()
    Image.open(file).convert("RGB").save(buffer, "JPEG")
    file.write_bytes(buffer.getvalue())


def other_size(file: Path) -> None:
    file.write_bytes(encode_png(np.zeros((7, 9, 4), np.uint8)))


def other_camera(file: Path) -> None:
    content = json.loads(file.read_text())
    del content["frames"][1]["toonset"]
    file.write_text(json.dumps(content))


def other_sigma(file: Path) -> None:
    content = json.loads(file.read_text())
    content["views"] = content["views"][::-1]
    file.write_text(json.dumps(content))


def path_outside(file: Path) -> None:
    file.write_text(file.read_text().replace("images/001.png", "../../mage/bundle/images/001.png"))


@pytest.mark.parametrize(
    ("name", "harm", "said"),
    [
        ("images/001.png", cut, "damaged or cut off"),
        ("images/001.png", Path.unlink, "does not exist"),
        ("images/001.png", leads_out, "lies outside of the folder"),
        ("images/001.png", as_jpeg, "is no PNG"),
        ("images/001.png", other_size, "is 9 x 7 px"),
        ("labels/002.png", cut, "damaged or cut off"),
        ("labels/002.png", Path.unlink, "is missing"),
        ("labels/002.png", leads_out, "is a link out of the folder"),
        ("palette.json", Path.unlink, "is missing"),
        ("palette.json", cut, "is no valid JSON"),
        ("calibration.json", Path.unlink, "is missing"),
        ("calibration.json", other_sigma, "has other cameras than"),
        ("transforms.json", Path.unlink, "holds no transforms.json"),
        ("transforms.json", other_camera, "has other cameras than"),
        ("transforms.json", path_outside, "lies outside of the folder"),
        ("", shutil.rmtree, "is not there"),
    ],
)
def test_a_damaged_bundle_is_one_line_that_names_it_and_nothing_is_written(
    batch: Path, tmp_path: Path, name: str, harm: Callable[[Path], object], said: str
) -> None:
    out = tmp_path / "out"
    shutil.copytree(batch, out)
    harm(out / "sheets" / "knight-2" / "bundle" / name)
    before = contents(tmp_path)
    reason = pack(out, "--to", "webdataset", "-o", tmp_path / "set", "--quiet").reason
    assert "knight-2" in reason
    assert said in reason
    assert contents(tmp_path) == before


def test_a_sheet_that_changes_meanwhile_stops_it(
    batch: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    shutil.copytree(batch, out)
    whole = verb._choose

    def choose_and_change(*arguments: Any) -> Any:
        found = whole(*arguments)
        shutil.copyfile(
            out / "sheets/mage/bundle/images/001.png", out / "sheets/mage/bundle/images/000.png"
        )
        return found

    monkeypatch.setattr(verb, "_choose", choose_and_change)
    reason = pack(out, "--to", "webdataset", "-o", tmp_path / "set", "--quiet").reason
    assert reason.startswith("mage: has changed while it was packed")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--split", "80,20"), "is not three shares"),
        (("--split", "0,0,0"), "is not three shares"),
        (("--split", "-1,1,1"), "is not three shares"),
        (("--split", "nan,1,1"), "is not three shares"),
        (("--verdict", "fine"), "'fine' is not one of 'ok'"),
        (("--verdict", "failed"), "has no sheet to pack"),
        (("--to", "zip"), "'zip' is not one of 'webdataset'"),
        (("--shard-size", "0"), "--shard-size"),
        (("-o", "full"), "exists already"),
        (("-o", "full", "--force"), "does not write"),
        (("-o", "theirs", "--force"), "has no card.json"),
        (("-o", ".", "--force"), "does not write"),
    ],
)
def test_a_mistake_is_told_and_nothing_is_written(
    batch: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("full").mkdir()
    Path("full/mine.txt").touch()
    Path("theirs/train").mkdir(parents=True)
    Path("theirs/train/cat.jpg").touch()
    before = contents(tmp_path)
    to = () if "--to" in words else ("--to", "webdataset")
    assert said in pack(batch, *to, *words, "--quiet").reason
    assert contents(tmp_path) == before


def test_nothing_done_is_one_line(make: Make, tmp_path: Path) -> None:
    out = make(tmp_path / "out", [Sheet("s", state="failed"), Sheet("t", state="quarantined")])
    reason = pack(out, "--to", "webdataset", "-o", tmp_path / "set").reason
    assert "has no sheet to pack (1 failed, 1 quarantined)" in reason
    assert not (tmp_path / "set").exists()


def test_a_folder_that_is_no_batch_is_told(tmp_path: Path) -> None:
    assert "has no batch.sqlite" in pack(tmp_path, "--to", "folder", "-o", tmp_path / "set").reason
    (tmp_path / "batch-1of2.sqlite").touch()
    assert "--merge" in pack(tmp_path, "--to", "folder", "-o", tmp_path / "set").reason


def test_parquet_without_pyarrow_is_told_how_to_install_it(
    batch: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.delitem(sys.modules, "pyarrow.parquet", raising=False)
    reason = pack(batch, "--to", "parquet", "-o", tmp_path / "set").reason
    assert "pip install 'toonset[parquet]'" in reason
    assert not (tmp_path / "set").exists()


def test_force_replaces_a_data_set_with_one_of_another_format(
    batch: Path, packed: dict[str, Path], tmp_path: Path
) -> None:
    place = tmp_path / "set"
    for kind in ("folder", "webdataset", "folder"):
        assert pack(batch, "--to", kind, "-o", place, "--force").code == 0
        assert contents(place) == contents(packed[kind])
