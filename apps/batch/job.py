"""Run one sheet's stages in this process: what every worker does, wherever it runs.

A stage's result is the verb's own files, which appear in one step, and a stamp beside them, which
says of what inputs, options and versions they are. A stage whose stamp says what is wanted is not
run again, whatever the table has forgotten.
"""

from __future__ import annotations

import base64
import contextlib
import errno
import hashlib
import itertools
import os
import shutil
import sys
import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from toonset import lock
from toonset.apps.batch.logged import BEGINS, forget_peak, last_lines, logged, peak_mb
from toonset.apps.batch.rows import StageRow
from toonset.apps.batch.stages import BUNDLE, STAGES, Verbs, dependents, line_of, value_of
from toonset.apps.batch.stamps import read_stamp, remove_stamps, stages_there, stamp_of
from toonset.errors import OutputError, ToonsetError, one_line
from toonset.write import write_json

LOG, SCRATCH = "log.txt", ".scratch"  # in a sheet's folder
PATIENCE_S = 30.0  # for the worker of a batch that has just been killed
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)  # whoever says so; another is an input's too
FINE = (0, 3)  # exit codes of verbs that have written
Kind = Literal["done", "failed", "busy", "place", "gone"]


@dataclass(frozen=True)
class Job:
    """A sheet to run.

    Attributes:
        name: of the sheet.
        sheets: its drawings: paths or URLs.
        words: of the stages' command lines.
        keys: what each stage's result is to be of, in order.
        home: the sheet's folder.
        store: URL that the folder is copied to; "": it stays where it is.
        seconds: that it may take; 0: no limit.
        memory_mb: most that its process may take; 0: no limit.
    """

    name: str
    sheets: tuple[str, ...]
    words: Mapping[str, tuple[str, ...]]
    keys: Mapping[str, str]
    home: str
    store: str = ""
    seconds: float = 0.0
    memory_mb: int = 0


@dataclass(frozen=True)
class Outcome:
    """How a sheet ended.

    Attributes:
        name: of the sheet.
        kind: done; failed, by its own fault; busy: another process is at it; place: the place for
            results cannot be written; gone: its process died.
        rows: of the stages that ended.
        line: why, where it is not done.
        log: last lines of what was printed, of a process that died.
        stage: that was run then.
        from_outside: of what is gone: somebody killed the process.
        pictures: small ones for the page, by file name, in base64.
    """

    name: str
    kind: Kind
    rows: tuple[StageRow, ...] = ()
    line: str = ""
    log: str = ""
    stage: str = ""
    from_outside: bool = False
    pictures: Mapping[str, str] = field(default_factory=dict)


def run_sheet(job: Job, verbs: Verbs) -> Outcome:
    """Run the stages of a sheet that are not done yet; whatever happens, say how it ended."""
    home = Path(job.home)
    try:
        home.mkdir(parents=True, exist_ok=True)
        with lock.hold(home / "batch", home, PATIENCE_S), logged(home / LOG, job.memory_mb):
            _sweep(home)
            outcome = _run_near(job, home, verbs)
    except OutputError as error:
        return Outcome(job.name, "place" if _is_full(error) else "busy", line=one_line(error))
    except OSError as error:
        reason = error.strerror or str(error)
        line = f"{home}: cannot be written ({reason}); make room, or make it writable"
        return Outcome(job.name, "place", line=line)
    if outcome.kind == "done":
        (home / LOG).unlink(missing_ok=True)
    return outcome


def _run_near(job: Job, home: Path, verbs: Verbs) -> Outcome:
    """Run a sheet here; results of a store on a copy, which goes afterwards as copies of inputs."""
    from toonset.apps.batch.storage import fetch, looks, push

    url, near = f"{job.store.rstrip('/')}/{job.name}", home / SCRATCH / "results"
    try:
        if not job.store:
            return _run_stages(job, home, verbs)
        if looks(f"{url}/calibrate.json") is not None:
            fetch(url, near)
        (near / job.name).mkdir(parents=True, exist_ok=True)
        outcome = _run_stages(job, near / job.name, verbs)
        if outcome.rows:
            push(near / job.name, url, tuple(f"{stage}.json" for stage in STAGES))
        return outcome
    except ToonsetError as error:
        return Outcome(job.name, "place", line=one_line(error))
    finally:
        shutil.rmtree(home / SCRATCH, ignore_errors=True)


def _fetched(words: Sequence[str], places: Iterator[Path]) -> tuple[str, ...]:
    """Return words with the URLs among them as files here, each in a folder of its own."""
    from toonset.apps.batch.storage import fetch, is_url

    found = []
    for word in words:
        value = value_of(word)
        near = str(fetch(value, next(places))) if is_url(value) else value
        found.append(word.removesuffix(value) + near if value else word)
    return tuple(found)


def _run_stages(job: Job, home: Path, verbs: Verbs) -> Outcome:
    """Run what is not done of a sheet's stages, in order; what is made of one that fails is not."""
    rows: list[StageRow] = []
    cut: set[str] = set()
    for stage, key in job.keys.items():
        row = read_stamp(home, stage, key)
        if row is None and stage not in cut:
            remove_stamps(home, stage)
            ended = _run_stage(job, home, stage, key, verbs)
            if isinstance(ended, Outcome):
                return replace(ended, rows=tuple(rows), pictures=_pictures(home))
            row = ended
            if row.state == "done":
                write_json(stamp_of(home, stage), asdict(row))
            else:
                cut |= {*dependents(stage)}
        rows += [row] if row is not None else []
    line = next((row.error for row in rows if row.error), "")
    kind: Kind = "failed" if line else "done"
    return Outcome(job.name, kind, tuple(rows), line, pictures=_pictures(home))


def _run_stage(job: Job, home: Path, stage: str, key: str, verbs: Verbs) -> StageRow | Outcome:
    """Run one stage; return its row, or the outcome where the sheet is not at fault."""
    given = job.words.get(stage, ())
    row = StageRow(stage, key, attempts=1, worker=f"{os.uname().nodename}:{os.getpid()}")
    print(f"{BEGINS}{stage}", file=sys.stderr)
    print(line_of(stage, given, job.sheets, home), file=sys.stderr, flush=True)
    forget_peak()
    began, cpu = time.monotonic(), time.process_time()
    said: Mapping[str, Any] = {}
    code, line, full, is_held = 0, "", False, False
    inputs = Path(job.home, SCRATCH, "inputs", stage)
    places = (inputs / str(number) for number in itertools.count())
    try:
        sheets = job.sheets if STAGES[stage].after else _fetched(job.sheets, places)
        words = _fetched(given, places)
        with lock.command():
            code, said = verbs.run(stage, words, sheets, home)
    except Exception as error:
        found = verbs.refusal(error)
        if found is None:
            traceback.print_exc()
        line = found or f"this is a bug of toonset: {type(error).__name__}: {one_line(error)}"
        full, is_held = _is_full(error), isinstance(error.__cause__, BlockingIOError)
    row = replace(
        row,
        ended=time.time(),
        wall_s=round(time.monotonic() - began, 4),
        cpu_s=round(time.process_time() - cpu, 4),
        peak_mb=round(peak_mb(), 1),
    )
    if full:
        return Outcome(job.name, "place", line=line)
    if is_held:
        return Outcome(job.name, "busy", line=line)
    if code not in FINE:
        return Outcome(job.name, "busy", line=f"{stage} was ended")
    if line:
        print(line, file=sys.stderr, flush=True)
        return replace(row, state="failed", error=line, log=last_lines(Path(job.home, LOG)))
    verdict, facts = _facts(stage, said)
    output = _hash_output(home, stage)
    return replace(row, state="done", verdict=verdict, facts=facts, output=output)


def _is_full(error: BaseException | None) -> bool:
    """Return whether the place for results is at fault, not the sheet."""
    while error is not None:
        cause = error.__cause__
        wrote = isinstance(error, OutputError) and isinstance(cause, OSError)
        if isinstance(cause, BlockingIOError):
            return False  # another process holds it
        if wrote or (isinstance(error, OSError) and error.errno in FULL):
            return True
        error = cause
    return False


def _facts(stage: str, said: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """Return a stage's verdict, and what the page shows besides."""
    if stage == "calibrate":
        return said["verdict"], {"reason": said["reason"], "views": len(said["views"])}
    if stage == "palette":
        return "", {"colors": len(said["colors"])}
    if stage == "train":
        verdict = said["verdict"]
        return verdict["verdict"], {
            "psnr": said["train"]["psnr"],
            "reasons": list(verdict["reasons"]),
        }
    return "", {}


def _sweep(home: Path) -> None:
    """Clear away what a worker that was killed has left of the batch's own."""
    shutil.rmtree(home / SCRATCH, ignore_errors=True)
    for stamp in home.glob(f".*.json.*{lock.TEMPORARY}"):
        stamp.unlink(missing_ok=True)


def tidy(home: Path) -> None:
    """Clear away what a worker that was killed has left in its sheet's folder."""
    _sweep(home)
    writes = [home / stage.writes for stage in STAGES.values()]
    for place in (home / "batch", *writes, lock.set_of(home / BUNDLE / "palette.json")):
        if place.parent.is_dir():
            with contextlib.suppress(OutputError), lock.hold(place):
                pass


def _hash_output(home: Path, stage: str) -> str:
    """Return the hash of what a stage has written: names and bytes, but for files with seconds."""
    verb = STAGES[stage]
    root, found = home / verb.writes, hashlib.sha256()
    inner = home / STAGES["train"].writes  # lies in the bundle, and is another stage's
    for file in sorted([root] if root.is_file() else root.rglob("*")):
        is_others = stage != "train" and file.is_relative_to(inner) and not root == inner
        if file.is_file() and not is_others and file.name not in verb.timed:
            with open(file, "rb") as opened:
                digest = hashlib.file_digest(opened, "sha256").hexdigest()
            found.update(f"{file.relative_to(home).as_posix()}\0{digest}\n".encode())
    return found.hexdigest()


def _pictures(home: Path) -> dict[str, str]:
    """Return the page's small pictures of a sheet's results, by the end of their name."""
    from toonset.apps.batch.page import thumbnail, turn_thumbnail

    there, found = stages_there(home), {}
    with contextlib.suppress(ToonsetError):
        if "calibrate" in there:
            found[".webp"] = thumbnail(home / BUNDLE / "overlay.png")
    with contextlib.suppress(ToonsetError):  # a turn of several layers has no picture of itself
        if "render" in there:
            found[".turn.webp"] = turn_thumbnail(home / STAGES["render"].writes)
    return {name: base64.b64encode(data).decode() for name, data in found.items()}
