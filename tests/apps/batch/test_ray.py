"""`toonset batch --ray`: the same bytes on a cluster of two nodes, whatever becomes of them."""

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from lab.bench.batch.cluster import make_cluster
from lab.bench.batch.sheets import write_sheets
from tests.conftest import Command, contents
from toonset.apps.batch import on_ray
from toonset.cli.common.verb_stages import VERBS
from toonset.errors import ToonsetError

STAGES = ("--stages", "calibrate,palette")
ROOT = Path(__file__).resolve().parents[3]
ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT)}

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    made = make_cluster()
    yield made
    made.shutdown()


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("library")
    write_sheets(folder, 6, seed=5)
    data = (folder / "s0.png").read_bytes()
    (folder / "torn.png").write_bytes(data[: len(data) // 2])
    with (folder / "sheets.csv").open("a") as file:
        file.write("torn.png,body0.obj,torn,,\n")
    return folder


@pytest.fixture(scope="module")
def local(library: Path, toonset: Command) -> dict[str, str]:
    out = library.parent / "local"
    assert toonset("batch", library / "sheets.csv", "-o", out, *STAGES).code == 3
    return results(out)


def results(out: Path) -> dict[str, str]:
    found = contents(out / "sheets")
    return {name: value for name, value in found.items() if name.count("/") > 1}


def command(library: Path, out: Path, address: str) -> list[str]:
    words = ["batch", str(library / "sheets.csv"), "-o", str(out), *STAGES, "--ray", address]
    return [sys.executable, "-P", "-m", "toonset", *words]


def test_two_nodes_give_the_bytes_of_one_machine(
    library: Path, local: dict[str, str], cluster: Any, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    done = subprocess.run(command(library, out, cluster.address), capture_output=True, text=True)
    assert done.returncode == 3, done.stderr
    assert "torn: failed: " in done.stderr
    assert "Traceback" not in done.stderr
    assert results(out) == local


def test_a_lost_node_loses_no_sheet(
    library: Path, local: dict[str, str], cluster: Any, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    node = cluster.add_node(num_cpus=2)
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen([*command(library, out, cluster.address), "--json"], **pipes) as run:
        while run.poll() is None and not list(out.glob("sheets/*/log.txt")):
            time.sleep(0.05)
        time.sleep(1)
        cluster.remove_node(node, allow_graceful=False)
        told, said = run.communicate(timeout=300)
    assert run.returncode == 3, said
    assert json.loads(told)["failed"] == 1
    assert results(out) == local


def test_a_lost_head_ends_it_with_one_line_and_loses_nothing(
    library: Path, local: dict[str, str], tmp_path: Path
) -> None:
    out, other = tmp_path / "out", make_cluster()
    with subprocess.Popen(command(library, out, other.address), stderr=subprocess.PIPE) as run:
        while run.poll() is None and not list(out.glob("sheets/*/palette.json")):
            time.sleep(0.05)
        other.shutdown()
        _, said = run.communicate(timeout=300)
    assert run.returncode == 2, said
    assert said.decode().splitlines()[-1].startswith("toonset: the Ray cluster is gone; ")
    done = subprocess.run(command(library, out, "local"), capture_output=True, text=True)
    assert done.returncode == 3, done.stderr
    assert results(out) == local


def test_results_go_to_a_store(
    library: Path, local: dict[str, str], cluster: Any, tmp_path: Path
) -> None:
    out, store = tmp_path / "out", tmp_path / "store"
    words = command(library, out, cluster.address)
    done = subprocess.run([*words, "--store", f"file://{store}"], capture_output=True, text=True)
    assert done.returncode == 3, done.stderr
    found = contents(store)
    assert {name: found[name] for name in local if local[name] != "folder"} == {
        name: value for name, value in local.items() if value != "folder"
    }


def test_what_crashes_or_hangs_is_told_as_on_one_machine(
    library: Path, cluster: Any, tmp_path: Path
) -> None:
    for name in ("crash0.png", "hang0.png", "s0.png"):  # lab.kills.child behaves by names
        shutil.copy(library / "s0.png", tmp_path / name)
    words = [*("batch", str(tmp_path / "*.png"), "-o", str(tmp_path / "out"), "--json")]
    words += ["--with", f"calibrate --mesh {library / 'body0.obj'}", "--stages", "calibrate"]
    words += ["--time-limit", "20", "--ray", cluster.address]
    child = [sys.executable, "-P", "-m", "lab.kills.child", *words]
    done = subprocess.run(child, cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True)
    assert done.returncode == 3, done.stderr
    assert "crash0: quarantined: its worker ended by SIGSEGV, 3 times" in done.stderr
    assert "hang0: failed: took longer than 20 s; raise --time-limit" in done.stderr
    assert json.loads(done.stdout)["stages"]["calibrate"]["done"] == 1


def test_as_many_sheets_as_fit_run_at_once_and_none_that_fits_nowhere(
    cluster: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = []
    for memory_mb in (0, 100, 10**6):
        workers = on_ray.RayWorkers(cluster.address, VERBS, memory_mb=memory_mb)
        monkeypatch.setattr(on_ray, "FIT_S", -1 if memory_mb == 10**6 else 60)
        try:
            found.append(workers.capacity)
        except ToonsetError as error:
            found.append(str(error))
        finally:
            workers.close()
    assert found[:2] == [2, 2]
    assert str(found[2]).startswith("--ray: no node has 1 CPU and 1000000 MB of memory; ")


def test_no_cluster_is_told_in_one_line(library: Path, tmp_path: Path) -> None:
    words = command(library, tmp_path / "out", "127.0.0.1:1")
    done = subprocess.run(words, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2, done
    assert done.stderr.startswith("toonset: --ray 127.0.0.1:1: no cluster answers there; ")
    assert done.stderr.count("\n") == 1
