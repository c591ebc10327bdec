"""Let every system call that touches a verb's outputs fail, or the process be killed there.

    python -m lab.faults [CASE ...] [--quick] [--kills N] [--rounds N] [--signals N]

Whatever happens, the outputs are the old ones or the new ones, whole, once the next run has looked
at the place; nothing hidden stays; the exit code and the line on stderr fit.

Linux only. Exit code 1 and one line for everything that is wrong.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import shutil
import signal
import sys
import tempfile
from pathlib import Path

from lab.faults.cases import CASES, draw_sheet, make_input
from lab.faults.child import leaving
from lab.faults.every_call import every_call
from lab.faults.moments import kills, pairs, signals
from lab.faults.place import Place, Row


def main() -> None:
    """Print a table, and what is wrong."""
    one_thread = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
    os.environ |= dict.fromkeys(one_thread, "1")  # a fork loses the others
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # else a fork that has not begun goes on as we do
    parser = argparse.ArgumentParser(prog="lab.faults")
    parser.add_argument("cases", nargs="*", help=", ".join(case.name for case in CASES))
    parser.add_argument("--quick", action="store_true", help="one kind of error a call, in turn")
    parser.add_argument("--kills", type=int, default=0, help="at random moments, of each case")
    parser.add_argument("--rounds", type=int, default=0, help="of two processes, of each case")
    parser.add_argument("--signals", type=int, default=0, help="of each case")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    draw, total = random.Random(asked.seed), Row(0)
    with tempfile.TemporaryDirectory(prefix="toonset-faults-") as folder:
        inputs = Path(folder)
        if (child := os.fork()) == 0:
            with leaving(inputs / "err"):
                draw_sheet(inputs)
        os.waitpid(child, 0)
        for case in CASES:
            for start in case.starts if not asked.cases or case.name in asked.cases else ():
                for name in re.findall(r"{i}/(\S+)", f"{case.new} {case.old} {{i}}/{case.before}"):
                    make_input(inputs, name)
                place = Place(inputs, case, start)
                rows = {
                    "faults": every_call(place, quick=asked.quick),
                    "kills": kills(place, asked.kills, draw),
                    "signals": signals(place, asked.signals, draw),
                    "pairs": pairs(place, asked.rounds),
                }
                shutil.rmtree(place.root)
                counts = ", ".join(f"{r.tried} {name}" for name, r in rows.items() if r.tried)
                row = sum(rows.values(), Row(0))
                total += row
                print(f"{place.name}: {place.calls} calls; {counts}; {len(row.wrong)} wrong")
                print(*(f"  {line}" for line in row.wrong), sep="\n", end="\n" * bool(row.wrong))
                sys.stdout.flush()
    print(f"all: {total.tried} tried, {len(total.wrong)} wrong (seed {asked.seed})")
    sys.exit(bool(total.wrong))


if __name__ == "__main__":
    main()
