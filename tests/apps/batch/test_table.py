"""The table of a batch: claims, leases, what is due again, and what is no table."""

import json
import os
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from toonset.apps.batch.rows import Plan, StageRow
from toonset.apps.batch.stages import Entry
from toonset.apps.batch.table import Table
from toonset.apps.batch.table_file import TABLE
from toonset.errors import OutputError, ToonsetError

KEYS = {"calibrate": "k1", "palette": "k2", "train": "k3"}


def everything(name: str) -> set[str]:
    return set(KEYS)


def done(keys: dict[str, str] = KEYS) -> list[StageRow]:
    return [StageRow(stage, key, "done", ended=time.time()) for stage, key in keys.items()]


def put(table: Table, count: int = 3, keys: dict[str, str] = KEYS) -> list[str]:
    names = [f"s{number:03d}" for number in range(count)]
    plans = [Plan(Entry(name, ("x.png",)), i, keys) for i, name in enumerate(names)]
    table.plan(plans, everything)
    return names


@pytest.fixture
def table(tmp_path: Path) -> Iterator[Table]:
    with closing(Table(tmp_path / TABLE, make=True)) as opened:
        opened.choose(put(opened))
        yield opened


def states(table: Table, name: str = "s000") -> list[str]:
    row = table.row(name)
    assert row is not None
    return [one.state for one in row.stages]


def finish(table: Table, keys: dict[str, str] = KEYS) -> None:
    row = table.claim("me", 60)
    assert row is not None
    assert row.name == "s000"
    assert table.record("me", row.name, done(keys))


def test_sheets_are_claimed_in_order_and_once(table: Table) -> None:
    claims = [table.claim(who, 60) for who in ("a", "b", "a", "b")]
    assert [row and row.name for row in claims] == ["s000", "s001", "s002", None]
    assert sorted(table.runners()) == ["a", "b"]


def test_what_ended_a_worker_waits_for_the_others(table: Table) -> None:
    table.count_crash("s000", from_outside=False)
    table.count_crash("s001", from_outside=True)
    claims = [table.claim("a", 60) for _ in range(3)]
    assert [row and row.name for row in claims] == ["s002", "s000", "s001"]


def test_what_is_not_chosen_is_not_claimed(tmp_path: Path) -> None:
    with closing(Table(tmp_path / TABLE, make=True)) as table:
        put(table)
        table.choose(["s001"])
        assert [row and row.name for row in (table.claim("a", 60), table.claim("a", 60))] == [
            "s001",
            None,
        ]


def test_lease_that_is_over_is_anothers_and_its_owner_records_nothing(table: Table) -> None:
    assert table.claim("dead", -1) is not None
    row = next(row for _ in range(3) if (row := table.claim("b", 60)) and row.name == "s000")
    assert not table.record("dead", row.name, done())
    assert table.record("b", row.name, done())


def test_lease_that_is_renewed_is_kept(table: Table) -> None:
    for _ in range(3):
        table.claim("a", 0.01)
    table.renew("a", 60)
    time.sleep(0.02)
    assert table.claim("b", 60) is None
    table.release("a", "s001")
    claimed = table.claim("b", 60)
    assert claimed is not None
    assert claimed.name == "s001"


def test_the_same_plan_leaves_what_is_done(table: Table) -> None:
    finish(table)
    put(table)
    assert states(table) == ["done"] * 3
    assert states(table, "s001") == ["waiting"] * 3


@pytest.mark.parametrize(("changed", "left"), [("calibrate", 0), ("palette", 1), ("train", 2)])
def test_a_changed_stage_makes_itself_and_later_ones_due(
    table: Table, changed: str, left: int
) -> None:
    finish(table)
    later = list(KEYS)[list(KEYS).index(changed) :]
    put(table, keys=KEYS | {stage: "new" for stage in later})
    assert states(table) == ["done"] * left + ["waiting"] * (3 - left)


def test_what_is_gone_from_disk_is_due_again_with_what_came_after(table: Table) -> None:
    finish(table)
    table.plan([Plan(Entry("s000", ("x.png",)), 0, KEYS)], lambda name: {"calibrate", "train"})
    assert states(table) == ["done", "waiting", "waiting"]


def test_a_failed_sheet_waits_for_somebody_to_ask(table: Table) -> None:
    row = table.claim("me", 60)
    assert row is not None
    rows = [StageRow("calibrate", "k1", "failed", error="no figures")]
    table.record("me", row.name, rows)
    put(table)
    found = table.row(row.name)
    assert found is not None
    assert (found.state, found.error) == ("failed", "no figures")
    table.retry([row.name], ["palette"])
    assert table.row(row.name) == found  # another stage has failed
    table.retry([row.name], ["calibrate"])
    found = table.row(row.name)
    assert found is not None
    assert (found.state, found.error, found.stages[0].state) == ("waiting", "", "waiting")


def test_a_failed_sheet_whose_options_changed_is_due(table: Table) -> None:
    row = table.claim("me", 60)
    assert row is not None
    table.record("me", row.name, [StageRow("calibrate", "k1", "failed", error="x")])
    put(table, keys={stage: f"{key}'" for stage, key in KEYS.items()})
    assert states(table) == ["waiting"] * 3


def test_crashes_count_for_the_inputs_that_they_came_from(table: Table) -> None:
    assert [table.count_crash("s000", from_outside=False) for _ in range(2)] == [1, 2]
    put(table)
    assert table.count_crash("s000", from_outside=False) == 3
    put(table, keys=KEYS | {"calibrate": "mended"})
    assert table.count_crash("s000", from_outside=False) == 1


def test_a_redone_stage_makes_due_what_was_made_of_it(table: Table) -> None:
    finish(table)
    some = {stage: "new" for stage in ("calibrate", "palette")}
    put(table, 1, some)
    finish(table, some)
    assert states(table) == ["done", "done"]  # the run went with the old bundle


def test_other_options_wait_for_who_works_on_a_sheet(table: Table) -> None:
    table.claim("other", 60)
    put(table)
    with pytest.raises(ToonsetError, match="'s000' is being worked on with other inputs"):
        put(table, keys=KEYS | {"train": "new"})


def test_rows_come_back_as_they_were_put(table: Table) -> None:
    entry = Entry("t", ("a", "b"), {"train": ("--steps", "3")}, "Ann", "CC0", "<here>")
    table.plan([Plan(entry, 7, KEYS)], everything)
    row = table.row("t")
    assert row is not None
    assert (row.entry, row.position, row.state) == (entry, 7, "waiting")
    assert [one.name for one in table.rows()] == ["s000", "s001", "s002", "t"]


def test_rows_can_be_read_while_others_write(table: Table, tmp_path: Path) -> None:
    with closing(Table(tmp_path / TABLE)) as reader:
        rows = reader.rows()
        next(rows)
        finish(table)
        assert len(list(rows)) == 2


def test_hashes_hold_while_a_file_looks_the_same(table: Table) -> None:
    table.keep_hashes([("a.png", "size 3", "abc")])
    assert table.hash_of("a.png", "size 3") == "abc"
    assert table.hash_of("a.png", "size 4") is None


def test_a_runner_does_not_claim_what_it_has(table: Table) -> None:
    claims = [table.claim("me", -1) for _ in range(4)]
    assert [row and row.name for row in claims] == ["s000", "s001", "s002", None]
    other = table.claim("other", 60)
    assert other is not None


def test_who_asks_for_another_try_waits_for_who_runs_it(table: Table) -> None:
    row = table.claim("me", 60)
    assert row is not None
    rows = [StageRow("calibrate", "k1", "failed", error="no figures")]
    table.record("me", row.name, rows)
    put(table, keys=KEYS | {"export": "k4"})
    table.retry([row.name], ["calibrate"])
    assert table.claim("me", 60) is not None
    table.retry([row.name], ["calibrate"])
    found = table.row(row.name)
    assert found is not None
    assert found.state == "running"


def test_a_table_on_a_read_only_place_is_read_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)
    with closing(Table(tmp_path / TABLE, make=True)) as writer:
        put(writer, 20)
        with closing(Table(tmp_path / TABLE)) as reader:  # its rows are in the write-ahead file
            assert len(reader.names()) == 20
    assert not (tmp_path / f"{TABLE}-wal").exists()
    with closing(Table(tmp_path / TABLE)) as reader:
        assert len(reader.names()) == 20
    assert [path.name for path in tmp_path.iterdir()] == [TABLE]


def test_many_may_make_a_table_at_once(tmp_path: Path) -> None:
    for number in range(20):
        path, children = tmp_path / f"{number}.sqlite", []
        start = time.time() + 0.05
        for _ in range(4):
            if (child := os.fork()) == 0:
                code = 1
                try:
                    while time.time() < start:
                        pass
                    Table(path, make=True).close()
                    code = 0
                finally:
                    os._exit(code)
            children.append(child)
        assert [os.waitpid(child, 0)[1] for child in children] == [0] * 4


def test_a_sheet_can_be_taken_out_but_not_while_it_runs(table: Table) -> None:
    table.forget(["s001"])
    assert table.names() == ["s000", "s002"]
    table.claim("me", 60)
    with pytest.raises(ToonsetError, match="'s000' is being worked on"):
        table.forget(["s002", "s000"])
    assert table.names() == ["s000", "s002"]


def test_parts_are_put_together_and_the_newer_row_counts(table: Table, tmp_path: Path) -> None:
    with closing(Table(tmp_path / "part.sqlite", make=True, alone=True)) as part:
        put(part, 5)
        finish(table)
        table.take_in(part)
        assert states(table) == ["done"] * 3  # the part has not begun with it
        assert states(table, "s004") == ["waiting"] * 3
        put(part, 5, {"calibrate": "k1"} | {"palette": "new"})
        table.take_in(part)
        assert states(table)[:2] == ["waiting", "waiting"]


def test_a_parts_row_replaces_all_stages(table: Table, tmp_path: Path) -> None:
    finish(table)
    with closing(Table(tmp_path / "part.sqlite", make=True)) as part:
        part.choose(put(part, 1, {"calibrate": "other"}))
        finish(part, {"calibrate": "other"})
        table.take_in(part)
    assert states(table) == ["done"]  # what was made of the old one is gone


def test_a_store_is_remembered(table: Table, tmp_path: Path) -> None:
    table.store = "s3://bucket/results"
    with closing(Table(tmp_path / TABLE)) as other:
        assert other.store == "s3://bucket/results"
        other.store = ""
    assert table.store == ""


def test_many_processes_claim_every_sheet_once(tmp_path: Path) -> None:
    with closing(Table(tmp_path / TABLE, make=True)) as table:
        put(table, 60)
    children = []
    for number in range(4):
        child = os.fork()
        if child == 0:
            code = 1
            try:
                with closing(Table(tmp_path / TABLE)) as own:
                    own.choose([f"s{i:03d}" for i in range(60)])
                    mine = []
                    while (row := own.claim(str(number), 60)) is not None:
                        mine.append(row.name)
                    (tmp_path / f"{number}.json").write_text(json.dumps(mine))
                code = 0
            finally:
                os._exit(code)
        children.append(child)
    assert [os.waitpid(child, 0)[1] for child in children] == [0] * 4
    claimed = [json.loads((tmp_path / f"{number}.json").read_text()) for number in range(4)]
    assert sorted(name for names in claimed for name in names) == [f"s{i:03d}" for i in range(60)]


def test_what_is_no_table_is_said_in_a_line(tmp_path: Path) -> None:
    file = tmp_path / TABLE
    with pytest.raises(ToonsetError, match=r"has no batch\.sqlite"):
        Table(file)
    file.write_text("not a table at all, but long enough to be looked at" * 20)
    with pytest.raises(OutputError, match="cannot be used"):
        Table(file)
    file.unlink()
    with closing(sqlite3.connect(file)) as other:
        other.execute("CREATE TABLE mine (x)")
        other.commit()
    with pytest.raises(ToonsetError, match="is no table of toonset batch"):
        Table(file, make=True)
    with closing(sqlite3.connect(file)) as other:
        other.execute("PRAGMA user_version = 99")
    with pytest.raises(ToonsetError, match="is of a newer toonset"):
        Table(file)
