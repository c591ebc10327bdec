"""`toonset batch` on real sheets: the bytes of the verbs themselves, whoever runs them."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lab.bench.batch.sheets import write_sheets
from tests.conftest import Command, contents

STAGES = ("--stages", "calibrate,palette")


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of three sheets and a damaged one, with a manifest."""
    folder = tmp_path_factory.mktemp("library")
    manifest = write_sheets(folder, 3, seed=5)
    data = (folder / "s0.png").read_bytes()
    (folder / "torn.png").write_bytes(data[: len(data) // 2])
    with manifest.open("a") as file:
        file.write("torn.png,body0.obj,torn,,\n")
    return folder


@pytest.fixture(scope="module")
def ran(library: Path, toonset: Command) -> Path:
    """Return the folder of the batch of that library."""
    out = library.parent / "out"
    done = toonset("batch", library / "sheets.csv", "-o", out, *STAGES, "--workers", 2)
    assert done.code == 3
    assert "torn: failed: " in done.err
    assert "the PNG file is damaged or cut off" in done.err
    return out


def results(out: Path) -> dict[str, str]:
    """Return what lies in the sheets' folders but for stamps, which hold times, and logs."""
    found = contents(out / "sheets")
    return {name: value for name, value in found.items() if name.count("/") > 1}


def test_a_sheet_has_the_bytes_of_its_verbs(
    library: Path, ran: Path, toonset: Command, tmp_path: Path
) -> None:
    sheet, body = library / "s1.png", library / "body1.obj"
    toonset("calibrate", sheet, "--mesh", body, "-o", tmp_path / "bundle")
    toonset("palette", tmp_path / "bundle")
    assert contents(tmp_path / "bundle") == contents(ran / "sheets" / "s1" / "bundle")


def test_order_and_number_of_workers_change_no_byte(
    library: Path, ran: Path, toonset: Command, tmp_path: Path
) -> None:
    rows = (library / "sheets.csv").read_text().splitlines()
    upside_down = library / "upside_down.csv"
    upside_down.write_text("\n".join([rows[0], *rows[:0:-1]]) + "\n")
    toonset("batch", upside_down, "-o", tmp_path / "out", *STAGES, "--workers", 1)
    assert results(tmp_path / "out") == results(ran)


def test_the_same_command_does_nothing_more(library: Path, ran: Path, toonset: Command) -> None:
    before = contents(ran / "sheets")
    again = toonset("batch", library / "sheets.csv", "-o", ran, *STAGES, "--json")
    assert again.code == 3  # one has failed still
    assert again.json["stages"]["palette"] == {"done": 3, "not reached": 1}
    assert contents(ran / "sheets") == before


def test_status_says_where_it_stands(ran: Path, toonset: Command) -> None:
    lines = toonset("batch", "--status", ran).out.splitlines()
    assert lines[0] == "4 sheets: 3 done, 1 failed"
    assert lines[-1].startswith("torn: failed: ")
    assert toonset("batch", "--status", ran, "--json").json["sheets"] == {"done": 3, "failed": 1}


def test_a_mended_sheet_is_run_and_no_other(
    library: Path, ran: Path, toonset: Command, tmp_path: Path
) -> None:
    mended, out = tmp_path / "library", tmp_path / "out"
    shutil.copytree(library, mended)
    shutil.copytree(ran, out)
    shutil.copyfile(mended / "s0.png", mended / "torn.png")
    before = contents(out / "sheets")
    done = toonset("batch", mended / "sheets.csv", "-o", out, *STAGES)
    assert done.code == 0, done.err
    after = contents(out / "sheets")
    changed = {name for name in after if after[name] != before.get(name)}
    assert {name.split("/")[0] for name in changed} == {"torn"}


def test_a_run_of_fewer_stages_leaves_the_pages_pictures(
    library: Path, ran: Path, toonset: Command, tmp_path: Path
) -> None:
    out, options = tmp_path / "out", ("--only", "s0", "--with", "export --to gltf")
    shutil.copytree(ran, out)
    home, thumbs = out / "sheets" / "s0", out / "thumbs"
    (home / "turntable").mkdir()
    shutil.copy(home / "bundle" / "images" / "000.png", home / "turntable" / "000.png")
    shutil.copy(home / "palette.json", home / "render.json")
    stages = ("--stages", "calibrate,export")
    assert toonset("batch", library / "sheets.csv", "-o", out, *stages, *options).code == 0
    assert {file.name for file in thumbs.glob("s0.*")} == {"s0.webp", "s0.turn.webp"}


def test_other_options_of_one_stage_redo_that_stage(
    library: Path, ran: Path, toonset: Command, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    shutil.copytree(ran, out)
    bundle = out / "sheets" / "s0" / "bundle"
    cameras, colors = (bundle / "transforms.json").stat(), (bundle / "palette.json").read_bytes()
    options = ("--with", "palette --max-colors 2", "--only", "s0")
    assert toonset("batch", library / "sheets.csv", "-o", out, *STAGES, *options).code == 0
    assert (bundle / "transforms.json").stat().st_mtime_ns == cameras.st_mtime_ns
    assert (bundle / "palette.json").read_bytes() != colors


def test_results_go_where_they_are_asked_for(
    library: Path, ran: Path, toonset: Command, tmp_path: Path
) -> None:
    out, store = tmp_path / "out", tmp_path / "store"
    command = ("batch", library / "sheets.csv", "-o", out, *STAGES, "--only", "s0", "--only", "s1")
    assert toonset(*command, "--store", f"file://{store}").code == 0
    expected = {n: v for n, v in results(ran).items() if n[:2] in ("s0", "s1")}
    assert {n: v for n, v in contents(store).items() if n.count("/") > 1} == expected
    for more in ((), ("--store", f"file://{tmp_path}/another")):  # the others would lie elsewhere
        refused = toonset(*command, *more)
        assert refused.code == 2
        assert f"has its results in file://{store}; give the same --store" in refused.err
    (store / "s0" / "palette.json").write_text("{}")  # of whatever
    shutil.rmtree(store / "s1")
    assert toonset(*command, "--store", f"file://{store}").code == 0
    assert (store / "s1" / "bundle" / "transforms.json").is_file()
    assert not list((out / "sheets").rglob(".scratch"))


def test_sheets_and_meshes_behind_urls(
    library: Path, ran: Path, toonset: Command, tmp_path: Path
) -> None:
    options = f"calibrate --mesh file://{library / 'body1.obj'}"
    sheet = f"file://{library / 's1.png'}"
    done = toonset("batch", sheet, "-o", tmp_path / "out", *STAGES, "--with", options)
    assert done.code == 0, done
    there = contents(tmp_path / "out" / "sheets" / "s1" / "bundle")
    assert there == contents(ran / "sheets" / "s1" / "bundle")


def test_two_urls_of_one_name_are_two_files(
    library: Path, toonset: Command, tmp_path: Path
) -> None:
    for number, name in enumerate(("front", "side")):
        (tmp_path / name).mkdir()
        shutil.copyfile(library / f"s{number}.png", tmp_path / name / "view.png")
    words = ("--stages", "calibrate", "--json")
    done = toonset("batch", f"file://{tmp_path}/*/view.png", "-o", tmp_path / "o", *words)
    assert "two sheets are called 'view'" in done.err
    (tmp_path / "s.jsonl").write_text(
        json.dumps({"sheet": [f"memory://x/{name}/view.png" for name in ("front", "side")]})
    )
    import fsspec

    files = fsspec.filesystem("memory")
    for name in ("front", "side"):
        files.pipe_file(f"/x/{name}/view.png", (tmp_path / name / "view.png").read_bytes())
    done = toonset("batch", tmp_path / "s.jsonl", "-o", tmp_path / "out", *words)
    assert done.json["stages"]["calibrate"] == {"done": 1}, done


def test_an_input_that_cannot_be_read_fails_its_sheet_alone(
    library: Path, toonset: Command, tmp_path: Path
) -> None:
    words = (f"file://{library}/s0.png", "file:///proc/self/mem", "--stages", "calibrate")
    done = toonset("batch", *words, "-o", tmp_path / "out", "--json")
    assert (done.code, done.json["stages"]["calibrate"]) == (3, {"done": 1, "failed": 1}), done
    assert "mem: failed: file:///proc/self/mem: cannot be reached" in done.err


def test_another_tables_result_is_not_taken_for_ones_own(
    library: Path, ran: Path, toonset: Command, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    shutil.copytree(ran, out)
    command = ("batch", library / "sheets.csv", "-o", out, *STAGES, "--only", "s0")
    colors = out / "sheets" / "s0" / "bundle" / "palette.json"
    before = colors.read_bytes()
    toonset(*command, "--shard", "1/1", "--with", "palette --max-colors 2")
    assert colors.read_bytes() != before
    assert toonset(*command).code == 0
    assert colors.read_bytes() == before
    refused = toonset(*command, "--shard", "1/2")
    assert "has parts of another number, as batch-1of1.sqlite" in refused.err


def test_a_mesh_is_its_materials_too(library: Path, toonset: Command, tmp_path: Path) -> None:
    mesh, out = tmp_path / "body.obj", tmp_path / "out"
    text = (library / "body0.obj").read_text().splitlines()
    plain = [" ".join(line.split()[:4]) if line.startswith("v ") else line for line in text]
    mesh.write_text("\n".join(["mtllib body.mtl", "usemtl m", *plain]) + "\n")
    places = {str(mesh): tmp_path / "out", f"file://{mesh}": tmp_path / "url"}
    found = []
    for red in (1, 0):
        (tmp_path / "body.mtl").write_text(f"newmtl m\nKd {red} 0 1\n")
        for place, out in places.items():
            given = ("--stages", "calibrate", "--with", f"calibrate --mesh {place}")
            if red or place == str(mesh):
                assert toonset("batch", library / "s0.png", "-o", out, *given).code == 0
            found.append((out / "sheets" / "s0" / "bundle" / "mannequin.obj").read_bytes())
    here, there, changed, _ = found
    assert here == there
    assert changed != here


def test_a_sheet_that_is_named_no_longer_is_told_and_can_be_forgotten(
    library: Path, ran: Path, toonset: Command, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    shutil.copytree(ran, out)
    fewer = library / "fewer.csv"
    fewer.write_text("".join((library / "sheets.csv").read_text().splitlines(True)[:3]))
    done = toonset("batch", fewer, "-o", out, *STAGES)
    assert (done.code, done.err.splitlines()[0]) == (
        0,
        "2 sheets not named now, kept (s2, torn); see --forget",
    )
    assert toonset("batch", "-o", out, "--forget", "t*", "--forget", "s2").code == 0
    assert toonset("batch", "--status", out, "--json").json["sheets"] == {"done": 2}
    assert "s2" not in (out / "index.html").read_text()
    assert not list((out / "thumbs").glob("s2.*"))
    assert (out / "sheets" / "s2").is_dir()
    assert "--forget 'x': no sheet is called so" in toonset("batch", "-o", out, "--forget", "x").err


def test_a_folder_of_views_behind_a_url_is_its_files(tmp_path: Path) -> None:
    from toonset.apps.batch.storage import content_hash

    for name in ("a", "b"):
        (tmp_path / f"{name}.png").write_text(name)
    before = content_hash(f"file://{tmp_path}")
    (tmp_path / "b.png").write_text("c")
    assert content_hash(f"file://{tmp_path}") != before


def test_parts_are_merged(library: Path, ran: Path, toonset: Command, tmp_path: Path) -> None:
    out = tmp_path / "out"
    for part in ("1/2", "2/2"):
        toonset("batch", library / "sheets.csv", "-o", out, *STAGES, "--shard", part)
    assert not (out / "index.html").exists()
    assert toonset("batch", "--merge", out, "--json").json["sheets"] == 4
    assert (out / "index.html").is_file()
    assert toonset("batch", "--status", out, "--json").json["sheets"] == {"done": 3, "failed": 1}
    assert results(out) == results(ran)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("-o", "o"), "name sheets"),
        (("s.png",), "with -o"),
        (("--status", "o", "-o", "p"), "and nothing beside it"),
        (("--status", "o", "--forget", "a"), "and nothing beside it"),
        (("--status", "nowhere"), "has no batch.sqlite"),
        (("--merge", "nowhere"), "has no batch-*of*.sqlite"),
        (("s.png", "-o", "o", "--stages", "calibrat"), "did you mean 'calibrate'"),
        (("s.png", "-o", "o", "--stages", "render,calibrate"), "render needs train; add it"),
        (("s.png", "-o", "o", "--stages", "calibrate,train"), "train needs palette; add it"),
        (("s.png", "-o", "o", "--stages", ""), "names no stage"),
        (("s.png", "-o", "o", "--shard", "0/3"), "is not I/N"),
        (("s.png", "-o", "o", "--shard", "4/3"), "is not I/N"),
        (("s.png", "-o", "o", "--workers", "0"), "neither a number from 1 nor auto"),
        (("s.png", "-o", "o", "--only", "t*"), "no sheet is called so"),
        (("s.png", "-o", "o", "--with", "paint --x"), "begins with none of calibrate"),
        (("s.png", "-o", "o", "--with", "train --steps"), "--with train: "),
        (("s.png", "-o", "o", "--with", "train --quiet"), "--quiet is set by toonset batch"),
        (("s.png", "-o", "o", "--gpus", "1"), "--gpus belongs to --ray"),
        (("s.png", "-o", "o", "--stages", "calibrate,export"), "Missing option '--to'"),
        (("t.png", "-o", "o"), "no such file"),
        (("s.png", "-o", "s.png"), "is a file, a folder is needed"),
        (("s.png", "-o", "full"), "holds files, but no batch.sqlite"),
        (("s.png", "-o", "o", "--with", "palette --min-share 2"), "2 is no share; give 0 to 1"),
        (("s.png", "-o", "o", "--with", "calibrate --views a,b"), "'a' is no direction"),
        (("s.png", "-o", "o", "--with", "calibrate --grid x"), "s: calibrate: --grid"),
        (("s.png", "-o", "o", "--forget", "a"), "takes -o OUT, and no sheets beside it"),
        (("-o", "full", "--forget", "a"), "has no batch.sqlite"),
    ],
)
def test_a_mistake_is_told_before_anything_runs(
    toonset: Command,
    library: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copyfile(library / "s0.png", "s.png")
    Path("full").mkdir()
    Path("full/mine.txt").touch()
    before = contents(tmp_path)
    assert said in toonset("batch", *words).reason
    assert contents(tmp_path) == before


def test_a_read_only_place_is_told_in_one_line(
    library: Path, toonset: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    (out / "sheets").mkdir(parents=True)
    (out / "sheets" / "s0").write_text("a file where a folder should be")
    (out / "batch.sqlite").touch()
    done = toonset("batch", library / "sheets.csv", "-o", out, *STAGES, "--only", "s0")
    assert done.code == 2
    assert "cannot be written" in done.err
    (out / "sheets" / "s0").unlink()
    assert toonset("batch", library / "sheets.csv", "-o", out, *STAGES, "--only", "s0").code == 0


def test_ctrl_c_leaves_a_batch_that_goes_on(library: Path, ran: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "toonset", "batch", str(library / "sheets.csv")]
    command += ["-o", str(tmp_path / "out"), *STAGES]
    script = (
        "import os, signal, subprocess, sys, time\n"
        "signal.signal(signal.SIGINT, signal.SIG_DFL)\n"
        "process = subprocess.Popen(sys.argv[2:], start_new_session=True)\n"
        "while not os.path.exists(sys.argv[1]): time.sleep(0.01)\n"
        "os.killpg(process.pid, signal.SIGINT)\n"
        "sys.exit(process.wait())\n"
    )
    sign = tmp_path / "out" / "sheets" / "s0" / "log.txt"
    first = subprocess.run([sys.executable, "-c", script, str(sign), *command], capture_output=True)
    assert first.returncode == 130, first.stderr
    assert b"Traceback" not in first.stderr
    assert b"the same command continues\n" in first.stderr
    assert '"running"' not in (tmp_path / "out" / "index.html").read_text().split("<script")[-2]
    second = subprocess.run(command, capture_output=True)
    assert second.returncode == 3, second.stderr
    assert results(tmp_path / "out") == results(ran)
    assert not [path for path in (tmp_path / "out").rglob(".*")]


def test_what_failed_is_in_the_table_for_others(ran: Path) -> None:
    import sqlite3

    with sqlite3.connect(f"file:{ran / 'batch.sqlite'}?mode=ro", uri=True) as table:
        found = table.execute("SELECT sheet, error FROM stages WHERE state = 'failed'").fetchall()
        peaks = [row[0] for row in table.execute("SELECT peak_mb FROM stages WHERE state='done'")]
        facts = table.execute("SELECT facts FROM stages WHERE stage = 'palette'").fetchone()
    assert [name for name, _ in found] == ["torn"]
    assert min(peaks) > 50
    assert json.loads(facts[0])["colors"] > 2
    assert os.path.getsize(ran / "batch.sqlite") < 200_000
