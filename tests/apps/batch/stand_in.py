"""A stage that takes no time: a sheet is a text file that says how to behave."""

import json
import os
import signal
import time
from collections import Counter
from collections.abc import Container, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from toonset.apps.batch.dispatch import Limits, Runner, home_of
from toonset.apps.batch.job import run_sheet
from toonset.apps.batch.local import LocalWorkers
from toonset.apps.batch.rows import Plan, SheetRow, StageRow
from toonset.apps.batch.stages import STAGES, Entry
from toonset.apps.batch.stamps import stages_there
from toonset.apps.batch.table import Table
from toonset.apps.batch.table_file import TABLE
from toonset.cli.common.verb_stages import VERBS
from toonset.errors import OutputError, SheetError
from toonset.write import new_folder, write_json

count_in: Path | None = None  # which stages were run; None: OUT/runs
CHOSEN = ("calibrate", "palette")


def run(
    stage: str, words: Sequence[str], sheets: Sequence[str], home: Path
) -> tuple[int, dict[str, Any]]:
    """Write what the stage would, or do what the sheet says; count it in `runs`."""
    made = home / "bundle" / "transforms.json"  # where the sheet is behind a URL
    text = (
        Path(sheets[0]).read_text()
        if Path(sheets[0]).is_file()
        else json.loads(made.read_text())[0]
    )
    with open(count_in or home.parents[1] / "runs", "a") as file:
        file.write(f"{home.name} {stage}\n")
    what, _, where = text.partition(" ")
    if where in ("", stage):
        _behave(what, home)
    verb = STAGES[stage]
    if stage in ("calibrate", "export"):
        with new_folder(home / verb.writes, force=True) as folder:
            write_json(folder / (verb.mark or "made.json"), [text, list(words)])
    else:
        write_json(home / verb.writes / verb.mark, [text, list(words)])
    return 0, {"verdict": "ok", "reason": "", "views": [1], "colors": [1, 2]}


STAND_IN = replace(VERBS, run=run)
run_one = partial(run_sheet, verbs=STAND_IN)


def _behave(what: str, home: Path) -> None:
    if what == "fail":
        raise SheetError("sheet.png: no figures; draw some")
    if what == "bug":
        raise KeyError("views")
    if what == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    if what == "exit":
        os._exit(7)
    if what == "killed":  # by somebody else, the first three times
        tries = (home / "tries").read_text() if (home / "tries").is_file() else ""
        (home / "tries").write_text(f"{tries}x")
        if len(tries) < 3:
            os.kill(os.getpid(), signal.SIGKILL)
    if what == "hang":
        time.sleep(600)
    if what == "eat":
        held = [bytes([n]) * (1 << 27) for n in range(1, 33)]
        time.sleep(len(held))
    if what == "held":
        raise OutputError("bundle: is in use by another toonset") from BlockingIOError()
    if what == "talk":
        print("\n".join(f"step {number}" for number in range(100)), flush=True)
        os.kill(os.getpid(), signal.SIGSEGV)
    if what == "slow":
        time.sleep(0.3)
    if what == "full" and not (home.parents[1] / "room").is_file():
        raise OSError(28, "No space left on device", str(home))


def make_table(
    out: Path, sheets: dict[str, str], words: Sequence[str] = (), stages: Sequence[str] = CHOSEN
) -> Table:
    """Return a table of sheets that behave as they say."""
    (out / "in").mkdir(parents=True, exist_ok=True)
    plans = []
    for position, (name, text) in enumerate(sheets.items()):
        file = out / "in" / f"{name}.txt"
        file.write_text(text)
        every = {"calibrate": text, "palette": " ".join((text, *words)), "export": f"{text} export"}
        every["train"] = f"{every['palette']} train"
        keys = {stage: every[stage] for stage in stages}
        entry = Entry(name, (str(file),), {"palette": tuple(words)}, name)
        plans.append(Plan(entry, position, keys))
    table = Table(out / TABLE, make=True)
    table.plan(plans, lambda name: stages_there(home_of(out, name)))
    table.choose(sheets)
    return table


def run_all(
    out: Path,
    sheets: dict[str, str],
    *,
    count: int = 2,
    limits: Limits = Limits(60),  # noqa: B008
    words: Sequence[str] = (),
    stages: Sequence[str] = CHOSEN,
    store: str = "",
) -> dict[str, SheetRow]:
    """Run sheets on local workers; return their rows."""
    ended: Counter[str] = Counter()

    def take(name: str, rows: Sequence[StageRow], due: Container[str]) -> None:
        ended[name] += 1

    with closing(make_table(out, sheets, words, stages)) as table:
        with closing(LocalWorkers(count, run_one)) as workers:
            Runner(out, limits, (*stages,), store).run(table, workers, take, lambda: None)
        assert set(ended.values()) <= {1}
        return {row.name: row for row in table.rows()}


def runs(out: Path) -> Counter[str]:
    """Return how often every stage of every sheet was run."""
    return Counter((out / "runs").read_text().splitlines())
