"""Judge how a command ended: what is called right, whatever the command was.

Exit code 0, 2 or 3 without a traceback; a refusal is one line that says what to do, and leaves
nothing; nothing lies hidden or outside of the output; no number in it is NaN; nothing raw reaches
the terminal; memory and CPU time stay in bounds.
"""

from __future__ import annotations

import json
import math
import os
import re
import signal
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

MOST_MB, MOST_CPU_S = 1500.0, 20.0
FINE, REFUSED, LOOK = 0, 2, 3  # exit codes
# A refusal says what to do: its last part begins with one of these, or has it after a comma.
DO = (
    "add build calibrate change check choose clean close convert correct crop cut draw drop export "
    "fix free give install join keep leave limit look lower make merge move name open pass put "
    "raise read rebuild reduce remove rename repair repeat rescale run save say scale see "
    "set show shrink simplify split start take train turn undistort unpack update use wait write"
).replace(" ", "|")
WHAT_TO_DO = re.compile(
    rf"(?:[;,:(?]|\bor) (?:first )?(?:{DO}|did you mean)\b[^;]*$|(?:`toonset | must )[^;]*$"
)
RAW = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")
NOT_FINITE = re.compile(rb"(?<![\w.-])-?(?:nan|inf|infinity)(?![\w.-])", re.IGNORECASE)
TEXTS = (".json", ".csv", ".obj", ".txt")


@dataclass(frozen=True)
class Ran:
    """How a process ended: exit code (negative: signal), what it printed, what it took."""

    code: int
    out: bytes
    err: bytes
    peak_mb: float = 0.0
    cpu_s: float = 0.0


def faults_of(ran: Ran, verb: str) -> list[str]:
    """Return what is wrong with how a command ended, whatever it was."""
    lines = ran.err.decode(errors="replace").splitlines()
    said = [line for line in lines if line.startswith("toonset: ")]
    last = lines[-1][:200] if lines else ""
    faults = []
    if ran.code < 0:
        faults.append(f"died of {signal.Signals(-ran.code).name}")
    elif ran.code not in (FINE, REFUSED, LOOK) or b"Traceback" in ran.err:
        faults.append(f"exit {ran.code}: {last}")
    elif ran.code == REFUSED and not (verb == "check" and ran.out and not said):
        if len(said) != 1 or lines[-1] != said[0]:
            faults.append(f"{len(said)} lines instead of one: {last}")
        elif WHAT_TO_DO.search(said[0]) is None:
            faults.append(f"does not say what to do: {last}")
    elif ran.code != REFUSED and said:
        faults.append(f"exit {ran.code}, but: {said[0]}")
    if "Warning: " in ran.err.decode(errors="replace"):
        faults.append(f"a library's warning: {next(x for x in lines if 'Warning: ' in x)[-160:]}")
    if RAW.search((ran.out + ran.err).decode(errors="replace")):
        faults.append("prints raw control characters")
    if ran.peak_mb > MOST_MB:
        faults.append(f"{ran.peak_mb:.0f} MB, at most {MOST_MB:.0f}")
    if ran.cpu_s > MOST_CPU_S:
        faults.append(f"{ran.cpu_s:.0f} CPU s, at most {MOST_CPU_S:.0f}")
    return faults


def entries(folder: Path) -> set[str]:
    """Return the names of everything below a folder."""
    return {os.path.relpath(os.path.join(at, name), folder) for at, *kinds in os.walk(folder)
            for names in kinds for name in names}  # fmt: skip


def left_behind(folder: Path, before: set[str], outputs: Sequence[str], ran: Ran) -> list[str]:
    """Return what a command has left that it should not, and numbers in it that are none."""
    if ran.code < 0:  # killed: what stays is swept by the next run
        return []
    new = sorted(entries(folder) - before)
    faults = [f"left {name!r}" for name in new if Path(name).name.startswith(".")]
    inside = [name for name in new if Path(name).parts[0] not in outputs]
    faults += [f"wrote {name!r} outside of the output" for name in inside[:1]]
    if ran.code == REFUSED:
        faults += [f"refused, but wrote {name!r}" for name in new[:1]]
    faults += [f"{name} holds a number that is none" for name in new if not finite(folder / name)]
    return faults


def finite(file: Path) -> bool:
    """Return whether a written file holds finite numbers only, as far as it holds numbers."""
    if file.suffix == ".safetensors" and file.is_file():
        from safetensors.numpy import load

        values = load(file.read_bytes()).values()
        return all(v.dtype.kind != "f" or bool((abs(v) < math.inf).all()) for v in values)
    if file.suffix not in TEXTS or not file.is_file():
        return True
    if file.suffix == ".json":
        odd: list[Any] = []
        json.loads(file.read_bytes(), parse_constant=odd.append)
        return not odd
    return NOT_FINITE.search(file.read_bytes()) is None
