"""What becomes of sheets whose workers fail, crash, hang, take too much, or are killed."""

import os
import signal
import threading
import time
from contextlib import closing
from pathlib import Path

import pytest

from tests.apps.batch import stand_in
from tests.apps.batch.stand_in import CHOSEN, make_table, run_all, run_one, runs
from toonset import lock
from toonset.apps.batch import dispatch, job
from toonset.apps.batch.dispatch import Limits, Runner, alive, home_of, release_dead
from toonset.apps.batch.job import Job, Outcome
from toonset.apps.batch.local import LocalWorkers, usual_workers
from toonset.apps.batch.rows import SheetRow
from toonset.apps.batch.stamps import stages_there
from toonset.apps.batch.table import Table
from toonset.apps.batch.table_file import TABLE
from toonset.errors import OutputError, ToonsetError

MOST_MB = 3000  # more than these tests' process has, less than a sheet that eats
RAISE = "raise --memory-limit, then --retry-failed"


@pytest.fixture(autouse=True)
def stands_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(job, "_pictures", lambda home: {})
    monkeypatch.setattr(dispatch, "LOOK_S", 0.05)


def test_every_sheet_is_run_once(tmp_path: Path) -> None:
    rows = run_all(tmp_path, {f"s{i}": "ok" for i in range(20)}, count=3)
    assert {row.state for row in rows.values()} == {"done"}
    assert {row.verdict for row in rows.values()} == {"ok"}
    assert set(runs(tmp_path).values()) == {1}
    assert len(runs(tmp_path)) == 20 * len(CHOSEN)
    assert not list(tmp_path.rglob("log.txt"))
    assert not [path for path in tmp_path.rglob(".*") if path.is_file()]


def test_the_same_again_runs_nothing(tmp_path: Path) -> None:
    sheets = {f"s{i}": "ok" for i in range(4)}
    run_all(tmp_path, sheets)
    assert run_all(tmp_path, sheets) == run_all(tmp_path, sheets)
    assert set(runs(tmp_path).values()) == {1}


def test_other_options_of_a_stage_run_that_stage(tmp_path: Path) -> None:
    run_all(tmp_path, {"a": "ok"})
    run_all(tmp_path, {"a": "ok"}, words=("--min-share", "0.1"))
    assert runs(tmp_path) == {"a calibrate": 1, "a palette": 2}
    run_all(tmp_path, {"a": "ok "}, words=("--min-share", "0.1"))
    assert runs(tmp_path) == {"a calibrate": 2, "a palette": 3}


@pytest.mark.parametrize(
    ("does", "state", "line", "tried"),
    [
        ("fail", "failed", "sheet.png: no figures; draw some", 1),
        ("bug", "failed", "this is a bug of toonset: KeyError: 'views'", 1),
        ("crash", "quarantined", "its worker ended by SIGSEGV, 3 times", 3),
        ("exit", "quarantined", "its worker ended with code 7, 3 times", 3),
        ("hang", "failed", "took longer than 5 s; raise --time-limit, then --retry-failed", 1),
        ("eat", "failed", f"took more than {MOST_MB} MB of memory; {RAISE}", 1),
    ],
)
def test_a_bad_sheet_is_told_and_the_others_are_done(
    tmp_path: Path, does: str, state: str, line: str, tried: int
) -> None:
    sheets = {"a": "ok", "bad": f"{does} palette", "c": "ok", "d": "ok"}
    rows = run_all(tmp_path, sheets, limits=Limits(5 if does == "hang" else 60, MOST_MB))
    bad = rows.pop("bad")
    assert {row.state for row in rows.values()} == {"done"}
    assert (bad.state, bad.error) == (state, line)
    assert [one.state for one in bad.stages] == ["done", state]
    assert "--- palette" in bad.stages[1].log
    assert runs(tmp_path) == {
        **{f"{name} {stage}": 1 for name in rows for stage in CHOSEN},
        "bad calibrate": 1,  # is not run again after a crash
        "bad palette": tried,
    }


def test_crash_leaves_its_last_lines(tmp_path: Path) -> None:
    row = run_all(tmp_path, {"a": "crash"})["a"]
    assert "Fatal Python error: Segmentation fault" in row.stages[0].log
    assert 'stand_in.py", line' in row.stages[0].log


def test_a_bug_leaves_its_traceback(tmp_path: Path) -> None:
    assert "Traceback" in run_all(tmp_path, {"a": "bug"})["a"].stages[0].log


def test_a_worker_that_is_killed_is_not_its_sheets_fault(tmp_path: Path) -> None:
    row = run_all(tmp_path, {"a": "killed palette", "b": "ok"})["a"]
    assert (row.state, row.crashes) == ("done", 0)
    assert runs(tmp_path)["a palette"] == 4


def test_a_full_disk_stops_all_with_one_line_and_loses_nothing(tmp_path: Path) -> None:
    with closing(make_table(tmp_path, {"a": "ok", "b": "full palette", "c": "slow"})) as table:
        runner = Runner(tmp_path, Limits(60), CHOSEN)
        with closing(LocalWorkers(1, run_one)) as workers, pytest.raises(OutputError) as caught:
            runner.run(table, workers, lambda *_: None, lambda: None)
        assert str(caught.value).isprintable()
        assert "No space left on device" in str(caught.value)
        assert {row.name: row.state for row in table.rows()} == {
            "a": "done",
            "b": "waiting",
            "c": "waiting",
        }
    before = runs(tmp_path)
    (tmp_path / "room").touch()
    rows = run_all(tmp_path, {"a": "ok", "b": "full palette", "c": "slow"})
    assert {row.state for row in rows.values()} == {"done"}
    assert runs(tmp_path) - before == {"b palette": 1, "c calibrate": 1, "c palette": 1}


def test_two_runners_share_the_sheets(tmp_path: Path) -> None:
    sheets = {f"s{i:02d}": "slow" for i in range(8)}
    make_table(tmp_path, sheets).close()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            run_all(tmp_path, sheets, count=1)
            code = 0
        finally:
            os._exit(code)
    rows = run_all(tmp_path, sheets, count=1)
    assert os.waitpid(child, 0)[1] == 0
    assert {row.state for row in rows.values()} == {"done"}
    assert set(runs(tmp_path).values()) == {1}
    assert len({one.worker for row in rows.values() for one in row.stages}) == 2


def test_what_a_dead_runner_had_is_run_by_the_next(tmp_path: Path) -> None:
    sheets = {f"s{i}": "ok" for i in range(3)}
    with closing(make_table(tmp_path, sheets)) as table:
        (tmp_path / dispatch.HOLDERS).mkdir()
        (tmp_path / dispatch.HOLDERS / "dead").touch()
        with alive(tmp_path, "living"):
            for who in ("dead", "living"):
                table.claim(who, 600)
            release_dead(table, tmp_path, "me")
            assert table.runners() == ["living"]


def test_workers_end_with_their_parent(tmp_path: Path) -> None:
    read, write = os.pipe()
    parent = os.fork()
    if parent == 0:
        os.close(read)
        table = make_table(tmp_path, {"a": "hang", "b": "hang"})
        workers = LocalWorkers(2, run_one)
        threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGKILL)).start()
        Runner(tmp_path, Limits(600), CHOSEN).run(table, workers, lambda *_: None, lambda: None)
        os._exit(0)
    os.close(write)
    assert os.waitstatus_to_exitcode(os.waitpid(parent, 0)[1]) == -signal.SIGKILL
    assert os.read(read, 1) == b""  # until all who have the other end are gone
    os.close(read)


def test_who_works_on_a_batch_must_do_the_same(tmp_path: Path) -> None:
    with alive(tmp_path, "one", "calibrate"):
        with alive(tmp_path, "two", "calibrate"):
            pass
        with pytest.raises(ToonsetError, match="with other stages or options"):
            with alive(tmp_path, "three", "palette"):
                pass
    with alive(tmp_path, "four", "palette"):
        pass
    assert not (tmp_path / dispatch.HOLDERS).exists()


def states(row: SheetRow) -> dict[str, str]:
    return {one.stage: one.state for one in row.stages}


def test_a_later_run_with_other_stages_keeps_results(tmp_path: Path) -> None:
    run_all(tmp_path, {"a": "ok"})
    row = run_all(tmp_path, {"a": "ok"}, stages=("calibrate", "export"))["a"]
    assert states(row) == {"calibrate": "done", "palette": "done", "export": "done"}
    assert set(runs(tmp_path).values()) == {1}


def test_a_redone_stage_takes_results_of_other_stages_with_it(tmp_path: Path) -> None:
    run_all(tmp_path, {"a": "ok"})
    row = run_all(tmp_path, {"a": "ok "}, stages=("calibrate", "export"))["a"]
    assert states(row) == {"calibrate": "done", "export": "done"}
    assert stages_there(home_of(tmp_path, "a")) == {"calibrate", "export"}


def test_a_failed_stage_is_not_forgotten_by_a_run_without_it(tmp_path: Path) -> None:
    run_all(tmp_path, {"a": "fail palette"})
    row = run_all(tmp_path, {"a": "fail palette"}, stages=("calibrate",))["a"]
    assert (row.state, row.error) == ("failed", "sheet.png: no figures; draw some")
    row = run_all(tmp_path, {"a": "fail palette"}, stages=("calibrate", "export"))["a"]
    assert states(row) == {"calibrate": "done", "palette": "failed", "export": "done"}
    assert row.state == "failed"
    assert set(runs(tmp_path).values()) == {1}


def test_tries_are_counted(tmp_path: Path) -> None:
    for _ in range(2):
        run_all(tmp_path, {"a": "ok"})
        (home_of(tmp_path, "a") / "calibrate.json").unlink()
    row = run_all(tmp_path, {"a": "ok"})["a"]
    assert [one.attempts for one in row.stages] == [3, 3]


def test_a_sheet_that_is_held_by_others_waits_and_stops_nobody(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dispatch, "MOST_KILLS", 2)
    make_table(tmp_path, {"a": "ok", "b": "ok"}).close()
    home = home_of(tmp_path, "a")
    home.mkdir(parents=True)
    child = os.fork()
    if child == 0:
        with lock.hold(home / "bundle"):
            (tmp_path / "held").touch()
            time.sleep(600)
    while not (tmp_path / "held").exists():
        time.sleep(0.01)
    rows = run_all(tmp_path, {"a": "ok", "b": "ok"})
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    assert rows["b"].state == "done"
    assert rows["a"].state == "quarantined"
    assert "is in use by another toonset" in rows["a"].error


def test_a_stage_that_is_held_is_the_one_that_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dispatch, "MOST_KILLS", 2)
    row = run_all(tmp_path, {"a": "held palette"})["a"]
    assert (row.state, states(row)) == (
        "quarantined",
        {"calibrate": "done", "palette": "quarantined"},
    )
    assert row.error == "bundle: is in use by another toonset, 2 times"


def test_what_does_not_need_a_failed_stage_is_run_and_the_failed_one_waits(tmp_path: Path) -> None:
    stages = (*CHOSEN, "train", "export")
    for _ in range(2):
        row = run_all(tmp_path, {"a": "fail palette"}, stages=stages)["a"]
        assert states(row) == {
            "calibrate": "done",
            "palette": "failed",
            "train": "waiting",
            "export": "done",
        }
        assert row.state == "failed"
    assert set(runs(tmp_path).values()) == {1}


def test_a_death_of_a_sheet_with_a_store_names_its_stage_and_waits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stand_in, "count_in", tmp_path / "runs")  # elsewhere than beside it
    store = f"file://{tmp_path}/store"
    for _ in range(2):
        row = run_all(tmp_path, {"a": "talk palette"}, store=store)["a"]
        assert states(row) == {"calibrate": "quarantined", "palette": "waiting"}
        assert row.error == "palette: its worker ended by SIGSEGV, 3 times"
    assert set(runs(tmp_path).values()) == {3}
    assert not list(tmp_path.rglob(".scratch"))


def test_a_picture_stays_where_a_later_stage_dies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(job, "_pictures", lambda home: {".webp": "AAAA"})
    run_all(tmp_path, {"a": "crash palette"}, stages=("calibrate",))
    run_all(tmp_path, {"a": "crash palette"})
    assert (tmp_path / "thumbs" / "a.webp").is_file()


def test_time_in_which_nothing_runs_does_not_count(tmp_path: Path) -> None:
    def large(job: Job) -> Outcome:
        return Outcome(job.name, "done", log="x" * 4_000_000)  # more than a pipe holds

    with closing(LocalWorkers(1, large)) as workers:
        for _ in range(2):
            workers.submit(Job("a", (), {}, {}, str(tmp_path), seconds=0.5))
            time.sleep(1)
            found: list[Outcome] = []
            while not found:
                found = workers.wait(0.1)
            assert [outcome.kind for outcome in found] == ["done"]


def test_a_runner_that_others_take_for_dead_is_alive_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lock_file, taken = dispatch.fcntl.flock, list[int]()

    def late(descriptor: int, how: int) -> None:
        if not taken:  # another has looked before the file was locked
            (tmp_path / dispatch.HOLDERS / "me").unlink()
        taken.append(descriptor)
        lock_file(descriptor, how)

    monkeypatch.setattr(dispatch.fcntl, "flock", late)
    with alive(tmp_path, "me", "calibrate"):
        assert (tmp_path / dispatch.HOLDERS / "me").read_text() == "calibrate"
        assert not dispatch._is_dead(tmp_path / dispatch.HOLDERS / "me")


def test_a_stamp_on_disk_counts_when_the_table_forgot(tmp_path: Path) -> None:
    run_all(tmp_path, {"a": "ok"})
    for file in tmp_path.glob(f"{TABLE}*"):
        file.unlink()
    assert run_all(tmp_path, {"a": "ok"})["a"].state == "done"
    assert set(runs(tmp_path).values()) == {1}


def test_what_a_killed_worker_was_writing_goes(tmp_path: Path) -> None:
    home = home_of(tmp_path, "a")
    (home / ".scratch" / "inputs").mkdir(parents=True)
    (home / ".calibrate.json.abcdefgh.tmp").write_text("{")
    run_all(tmp_path, {"a": "ok"})
    assert not list(home.glob(".*"))


def test_a_damaged_stamp_does_not_count(tmp_path: Path) -> None:
    run_all(tmp_path, {"a": "ok"})
    (home_of(tmp_path, "a") / "palette.json").write_text('{"stage": "pal')
    for file in tmp_path.glob(f"{TABLE}*"):
        file.unlink()
    run_all(tmp_path, {"a": "ok"})
    assert runs(tmp_path) == {"a calibrate": 1, "a palette": 2}


def test_the_parents_memory_does_not_grow_with_sheets(tmp_path: Path) -> None:
    def parents_kb() -> int:
        status = Path("/proc/self/status").read_text()
        return int(status.split("VmRSS:")[1].split()[0])

    run_all(tmp_path, {f"s{i:03d}": "ok" for i in range(20)})
    before = parents_kb()
    run_all(tmp_path, {f"s{i:03d}": "ok" for i in range(220)})
    assert parents_kb() - before < 4000


def test_workers_fit_into_the_memory() -> None:
    assert usual_workers(1) == len(os.sched_getaffinity(0))
    assert usual_workers(10**9) == 1


def test_a_table_can_be_looked_at_while_sheets_run(tmp_path: Path) -> None:
    seen = []
    with closing(make_table(tmp_path, {f"s{i}": "slow" for i in range(3)})) as table:

        def look() -> None:
            with closing(Table(tmp_path / TABLE)) as other:
                seen.append(sum(row.state == "done" for row in other.rows()))

        with closing(LocalWorkers(1, run_one)) as workers:
            Runner(tmp_path, Limits(60), CHOSEN).run(table, workers, lambda *_: None, look)
    assert seen == sorted(seen)
    assert seen[-1] == 3
