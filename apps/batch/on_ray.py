"""Run sheets on a Ray cluster: the same function that the processes of one machine run.

Ray has no more to do than there are cores, and the table knows all of it: what a lost node, or a
lost cluster, had to do is claimed again.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import time
from collections.abc import Iterator
from dataclasses import asdict
from functools import partial
from types import FrameType
from typing import Any

from toonset.apps.batch.job import Job, Outcome, run_sheet
from toonset.apps.batch.local import BY_SIGNAL, LocalWorkers, job_of, outcome_of
from toonset.apps.batch.stages import Verbs
from toonset.errors import SetupError, ToonsetError, one_line

HERE = "local"
LOOK_S = 1.0  # between looks at whether a sheet takes too long
GONE = "the Ray cluster is gone; with another one run the same command again"
FORKED: list[LocalWorkers] = []  # the one worker of a process of Ray's
FIT_S = 120.0  # for a node that sheets fit on: some clusters grow when they are asked
ANSWER_S = 5.0  # for a connection to a cluster
ASK_S = 5.0  # between questions for how many cores there are


def run_told(told: str, verbs: Verbs) -> str:
    """Run a sheet that is told as JSON, in a process forked from one of Ray's.

    So its limits count from its start, and what ends it is seen on its own node, with its last
    lines, whether or not that shares a disk with others.
    """
    job = job_of(json.loads(told))
    if not FORKED:
        verbs.load((*job.keys,))
        FORKED.append(LocalWorkers(1, partial(_run, verbs=verbs)))
    FORKED[0].submit(job)
    while not (ended := FORKED[0].wait(LOOK_S)):
        pass
    return json.dumps(asdict(ended[0]))


def _run(job: Job, verbs: Verbs) -> Outcome:
    """Run a sheet in a fork, where Ray's own answer to signals has no place."""
    signal.signal(signal.SIGTERM, _end)
    return run_sheet(job, verbs)


def _end(number: int, frame: FrameType | None) -> None:
    """Clear away what is half-written, and end."""
    raise SystemExit(BY_SIGNAL + number)


class RayWorkers:
    """Processes of a Ray cluster."""

    def __init__(self, address: str, verbs: Verbs, gpus: float = 0.0, memory_mb: int = 0) -> None:
        """Connect to a cluster.

        Args:
            address: of its head; "auto": as Ray finds it; "local": start one on this machine.
            verbs: that the stages are; every node finds them by their names.
            gpus: that a sheet takes, or a share of one.
            memory_mb: that a sheet may take.

        Raises:
            SetupError: Ray is not installed.
            ToonsetError: no cluster is there.
        """
        try:
            import ray
            import ray.exceptions
        except ImportError as error:
            raise SetupError("--ray needs Ray: pip install 'toonset[ray]'") from error
        self._ray: Any = ray
        self._verbs = verbs
        _check_answers(address, f"--ray {address}: no cluster answers there; `ray start --head`")
        self._hushed = contextlib.ExitStack()  # Ray prints what became of workers, as we do
        nowhere = self._hushed.enter_context(open(os.devnull, "w"))
        self._hushed.enter_context(contextlib.redirect_stdout(nowhere))
        environment = {"env_vars": {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}}
        try:
            ray.init(
                address=None if address == HERE else address,
                log_to_driver=False,
                include_dashboard=False if address == HERE else None,
                runtime_env=environment,
                configure_logging=False,
            )
        except (ConnectionError, ValueError, RuntimeError) as error:
            raise ToonsetError(f"--ray {address}: no cluster there ({one_line(error)})") from error
        memory = memory_mb * 2**20 if address != HERE else 0
        options = {"num_cpus": 1, "num_gpus": gpus, "memory": memory}
        shares = zip(("CPU", "GPU", "memory"), options.values(), strict=True)
        self._shares = {name: share for name, share in shares if share}
        self._run = ray.remote(**options, max_retries=0)(run_told)
        self._jobs = dict[Any, Job]()
        self._capacity, self._asked, self._fitted = 1, 0.0, time.monotonic()
        self._head = address if "://" in address else ray.get_runtime_context().gcs_address

    @property
    def capacity(self) -> int:
        """Return how many sheets the cluster's nodes can run at once, as of some seconds ago."""
        if time.monotonic() - self._asked > ASK_S:
            _check_answers(self._head, GONE)
            with self._lost():
                nodes = [node["Resources"] for node in self._ray.nodes() if node["Alive"]]
            self._asked = time.monotonic()
            self._capacity = sum(
                int(min(node.get(name, 0) / share for name, share in self._shares.items()))
                for node in nodes
            )
            self._fitted = self._asked if self._capacity else self._fitted
            if self._asked - self._fitted > FIT_S:
                mb = self._shares.get("memory", 0) / 2**20
                needs = [f"{self._shares[n]:g} {n}" for n in ("CPU", "GPU") if n in self._shares]
                needs += [f"{mb:.0f} MB of memory"] * (mb > 0)
                said = f"--ray: no node has {' and '.join(needs)}"
                raise ToonsetError(f"{said}; give less to a sheet, or add a node")
        return max(self._capacity, 1)

    def submit(self, job: Job) -> None:
        """Run a sheet on some node."""
        with self._lost():
            self._jobs[self._run.remote(json.dumps(asdict(job)), self._verbs)] = job

    def wait(self, timeout_s: float) -> list[Outcome]:
        """Return what has ended meanwhile; wait until something has, or the time is over."""
        with self._lost():
            ready, _ = self._ray.wait(list(self._jobs), num_returns=1, timeout=timeout_s)
            if ready:
                every = len(self._jobs)
                ready, _ = self._ray.wait(list(self._jobs), num_returns=every, timeout=0)
        return [self._outcome(reference) for reference in ready]

    def close(self) -> None:
        """End what runs, and leave the cluster."""
        for reference in self._jobs:
            with contextlib.suppress(Exception):  # the cluster may be what is gone
                self._ray.cancel(reference, force=True)
        self._ray.shutdown()
        self._hushed.close()

    def _outcome(self, reference: Any) -> Outcome:
        """Return how a sheet ended, or what became of its process."""
        job, errors = self._jobs.pop(reference), self._ray.exceptions
        try:
            return outcome_of(json.loads(self._ray.get(reference)))
        except (errors.NodeDiedError, errors.LocalRayletDiedError, errors.ObjectLostError) as error:
            return Outcome(job.name, "gone", line=_first(error), from_outside=True)
        except errors.OutOfMemoryError as error:
            return Outcome(job.name, "gone", line=f"its node ran out of memory: {_first(error)}")
        except (errors.WorkerCrashedError, errors.TaskCancelledError):
            return Outcome(job.name, "gone", line="its worker was killed", from_outside=True)
        except errors.RayError as error:
            said = one_line(str(error).strip().split("\n")[-1])
            raise ToonsetError(
                f"--ray: a node cannot run sheets ({said}); is toonset there?"
            ) from error

    @contextlib.contextmanager
    def _lost(self) -> Iterator[None]:
        """Say in one line that the cluster is gone."""
        try:
            yield
        except (self._ray.exceptions.RayError, ConnectionError) as error:
            raise ToonsetError(f"{GONE} ({_first(error)})") from error


def _check_answers(address: str, said: str) -> None:
    """Say so where nobody answers: Ray itself waits a minute, and ends the process."""
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if not colon or not port.isdecimal():
        return
    try:
        with socket.create_connection((host, int(port)), ANSWER_S):
            pass
    except (OSError, OverflowError) as error:
        raise ToonsetError(f"{said} ({one_line(error)})") from error


def _first(error: Exception) -> str:
    """Return the first line of what Ray says, which says much."""
    return one_line(str(error).strip().split("\n")[0])
