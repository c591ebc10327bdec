"""Run sheets in processes of this machine, forked from this one when all is imported.

Each runs one sheet after the other on one core. It hears of its sheets and tells of them through a
pipe, so that it is known at once when it dies; and it ends when this process does.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import signal
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from multiprocessing.connection import Connection, Pipe, wait
from pathlib import Path
from typing import Any

from toonset.apps.batch.job import LOG, Job, Outcome
from toonset.apps.batch.logged import last_lines, last_stage, over_memory
from toonset.apps.batch.rows import StageRow
from toonset.write import ENDINGS

WORKER_MB = 1500  # of memory, for a sheet of usual size and its training
BY_SIGNAL = 128  # plus the signal's number: exit code of a process that cleared up after it
PARENT_DIED = 1  # PR_SET_PDEATHSIG of Linux
GRACE_S = 2.0  # for a process to clear up what it was writing
RAISE = "raise --time-limit, then --retry-failed"


def usual_workers(memory_mb: int = 0) -> int:
    """Return how many sheets can run at once: one per core, as far as the memory goes."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    free = free_memory_mb()
    fitting = cores if free is None else int(free // (memory_mb or WORKER_MB))
    return max(1, min(cores or 1, fitting or 1))


def free_memory_mb() -> float | None:
    """Return the memory that is left, of the machine or of this process' control group."""
    found = []
    with contextlib.suppress(OSError, IndexError, ValueError):
        text = Path("/proc/meminfo").read_text()
        found.append(int(text.split("MemAvailable:")[1].split()[0]) / 1024)
    with contextlib.suppress(OSError, IndexError, ValueError):  # "max" is no limit
        group = Path("/sys/fs/cgroup")
        most, used = (int((group / f"memory.{name}").read_text()) for name in ("max", "current"))
        cached = (group / "memory.stat").read_text().split("inactive_file ")[1].split()[0]
        found.append((most - used + int(cached)) / 2**20)
    return max(min(found), 0) if found else None


@dataclass
class _Worker:
    """A process: its pipe, and the sheet that it runs."""

    pid: int
    pipe: Connection
    job: Job | None = None
    spent: float = 0.0
    is_late: bool = False
    ooms: int = 0

    def count(self, seconds: float) -> None:
        """Count time; kill it if its sheet takes longer than it may, and is not done by now."""
        self.spent += seconds
        limit = self.job.seconds if self.job is not None else 0
        if limit and self.spent > limit and not self.is_late and not self.pipe.poll():
            self.is_late = True
            os.kill(self.pid, signal.SIGKILL)


class LocalWorkers:
    """Processes of this machine."""

    def __init__(self, count: int, run: Callable[[Job], Outcome]) -> None:
        """Start them; from here on this process must have no threads.

        Args:
            count: of processes.
            run: what each does with a sheet.
        """
        use_one_core()  # here: a fork cannot end threads of before
        self._run, self._workers = run, list[_Worker]()
        self.capacity = count
        for _ in range(count):
            self._start()

    def submit(self, job: Job) -> None:
        """Give a sheet to a free worker."""
        worker = next(worker for worker in self._workers if worker.job is None)
        worker.job, worker.ooms = job, _ooms()
        worker.spent, worker.is_late = 0.0, False
        with contextlib.suppress(OSError):  # an earlier try's says nothing of this one
            Path(job.home, LOG).unlink()
        try:
            worker.pipe.send_bytes(json.dumps(asdict(job)).encode())
        except OSError:  # it has died meanwhile: `wait` says so
            pass

    def wait(self, timeout_s: float) -> list[Outcome]:
        """Return what has ended meanwhile; wait until something has, or the time is over."""
        found, began = list[Outcome](), time.monotonic()
        ready = wait([worker.pipe for worker in self._workers], timeout_s)
        waited = min(time.monotonic() - began, timeout_s)  # all may have been stopped meanwhile
        for worker in [worker for worker in self._workers if worker.pipe in ready]:
            try:
                found.append(outcome_of(json.loads(worker.pipe.recv_bytes())))
                worker.job = None
            except (EOFError, OSError):
                found += self._bury(worker)
        for worker in self._workers:
            worker.count(waited)
        return found

    def close(self) -> None:
        """End all workers; what they were writing is cleared away."""
        for worker in self._workers:
            os.kill(worker.pid, signal.SIGTERM if worker.job else signal.SIGKILL)
        until = time.monotonic() + GRACE_S
        for worker in self._workers:
            while os.waitpid(worker.pid, os.WNOHANG)[0] == 0:
                if time.monotonic() > until:
                    os.kill(worker.pid, signal.SIGKILL)
                time.sleep(0.01)
            worker.pipe.close()
        self._workers.clear()

    def _start(self) -> None:
        here, there = Pipe()
        sys.stdout.flush()
        sys.stderr.flush()
        parent, pid = os.getpid(), os.fork()
        if pid == 0:
            try:
                for worker in self._workers:
                    worker.pipe.close()
                here.close()
                _work(there, self._run, parent)
            finally:
                os._exit(1)
        there.close()
        self._workers.append(_Worker(pid, here))

    def _bury(self, worker: _Worker) -> list[Outcome]:
        """Replace a dead worker; return what became of its sheet."""
        self._workers.remove(worker)
        worker.pipe.close()
        _, status = os.waitpid(worker.pid, 0)
        code = os.waitstatus_to_exitcode(status)
        self._start()
        if worker.job is None:
            return []
        log = last_lines(Path(worker.job.home, LOG))
        late = f"took longer than {worker.job.seconds:g} s; {RAISE}" if worker.is_late else ""
        stage = last_stage(Path(worker.job.home, LOG))
        if over := late or over_memory(log):
            return [Outcome(worker.job.name, "failed", line=over, log=log, stage=stage)]
        number = -code if code < 0 else code - BY_SIGNAL
        by_signal = number in {*map(int, signal.Signals)}
        out_of_memory = number == signal.SIGKILL and _ooms() > worker.ooms
        line = f"its worker ended by {signal.Signals(number).name}" if by_signal else ""
        line += " (the system ran out of memory)" if out_of_memory else ""
        return [
            Outcome(
                *(worker.job.name, "gone"),
                line=line or f"its worker ended with code {code}",
                log=log,
                stage=stage,
                from_outside=number in {*ENDINGS, signal.SIGKILL} and not out_of_memory,
            )
        ]


def _work(pipe: Connection, run: Callable[[Job], Outcome], parent: int) -> None:
    """Run sheets as they come, until the other end of the pipe is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to hear
    _end_with_parent(parent)
    while True:
        try:
            told = json.loads(pipe.recv_bytes())
        except (EOFError, OSError):
            os._exit(0)
        try:
            outcome = run(job_of(told))
            pipe.send_bytes(json.dumps(asdict(outcome)).encode())
        except SystemExit as ended:  # by a signal: all is cleared away
            os._exit(ended.code if isinstance(ended.code, int) else 1)
        except OSError:  # the parent is gone
            os._exit(0)


def _end_with_parent(parent: int) -> None:
    """Let the system end this process when its parent dies, where it can."""
    with contextlib.suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).prctl(PARENT_DIED, signal.SIGTERM)
    if os.getppid() != parent:
        os._exit(0)


def use_one_core() -> None:
    """Let libraries that are there start no threads."""
    torch, cv2 = sys.modules.get("torch"), sys.modules.get("cv2")
    if torch is not None:
        torch.set_num_threads(1)
    if cv2 is not None:
        cv2.setNumThreads(1)


def _ooms() -> int:
    """Return how many processes the system has ended for memory, as far as it tells."""
    for file in ("/sys/fs/cgroup/memory.events", "/proc/vmstat"):
        with contextlib.suppress(OSError, StopIteration, ValueError):
            lines = Path(file).read_text().splitlines()
            return int(next(line for line in lines if line.startswith("oom_kill ")).split()[1])
    return 0


def job_of(told: dict[str, Any]) -> Job:
    """Return a job of its JSON."""
    words = {stage: tuple(said) for stage, said in told["words"].items()}
    return Job(**{**told, "sheets": tuple(told["sheets"]), "words": words})


def outcome_of(told: dict[str, Any]) -> Outcome:
    """Return an outcome of its JSON."""
    rows: Iterable[dict[str, Any]] = told["rows"]
    return Outcome(**{**told, "rows": tuple(StageRow(**row) for row in rows)})
