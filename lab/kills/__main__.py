"""`python -m lab.kills [--sheets 300] [--kills 10] [--ray]`: kill a batch again and again.

Workers are killed every few seconds and the batch itself so many times, each at a random moment;
2 % of the sheets are damaged and 1 % crash or hang their worker. Afterwards every good sheet must
have the bytes of an undisturbed run, and every bad one its line. Ends with 1 if anything is wrong.
"""

import argparse
import atexit
import os
import sys
import tempfile
from pathlib import Path

from lab.bench.batch.cluster import make_cluster
from lab.kills import kills

ROOT = Path(__file__).resolve().parents[2]


def main() -> int:
    """Run what the command line asks for; return the exit code."""
    parser = argparse.ArgumentParser(prog="lab.kills", description=__doc__)
    parser.add_argument("--sheets", type=int, default=300)
    parser.add_argument("--kills", type=int, default=10, help="of the batch itself")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--ray", action="store_true", help="on a Ray cluster of two nodes")
    given = parser.parse_args()
    os.environ["PYTHONPATH"] = str(ROOT)  # batches and Ray's processes find lab.kills.child so
    with tempfile.TemporaryDirectory() as place:
        work, library = Path(place), Path(place, "library")
        kills.make_library(library, given.sheets, given.seed)
        kills.run_undisturbed(library, work / "undisturbed", "--workers", "2")
        more, pace = ("--workers", "2"), kills.LOCAL
        if given.ray:
            cluster = make_cluster()
            atexit.register(cluster.shutdown)
            more, pace = ("--ray", cluster.address), kills.RAY
        told = kills.try_back_end(work, library, given.kills, given.seed, pace, *more)
        twice = kills.twice(work / "disturbed")
        print(
            f"{'ray' if given.ray else 'local'}: {given.sheets} sheets, {told.killed['workers']} "
            f"workers and {told.killed['batches']} batches killed in {told.seconds:.0f} s, {twice} "
            f"stages completed again, {len(told.wrong)} wrong"
        )
        for line in told.wrong[:20]:
            print(f"  {line}")
    return int(bool(told.wrong))


if __name__ == "__main__":
    sys.exit(main())
