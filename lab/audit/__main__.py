"""Try the command line with everything that can go wrong, and count what does.

    python -m lab.audit [ROW ...] [--seed N]

Each row is a function of the material that returns a `Row`. Tens of minutes for all of them; exit
code 1 if anything is wrong.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from lab.audit import (
    documents,
    environment,
    meshes,
    mutations,
    names,
    numbers,
    repeated,
    runs,
    sheets,
    soak,
)
from lab.audit.case import Row, import_everything
from lab.audit.material import Material, make_material

# Of the audit's rows R5 and the checkpoints of R4 (D14, D18, D22) are gone: nothing is resumed any
# more. Failing calls, kills, signals and neighbours (R6, R7, R8) are in lab/faults/.
ROWS: dict[str, tuple[str, Callable[[Material], Row]]] = {
    "R1": ("sheets", sheets.row),
    "R2": ("meshes", meshes.row),
    "R3": ("documents by hand", documents.by_hand),
    "R3m": ("documents mutated", mutations.row),
    "R4": ("run folders", runs.row),
    "R9": ("numbers, options", numbers.row),
    "R12": ("twice the same", repeated.row),
    "R14": ("environment", environment.row),
    "R15": ("hostile names", names.in_exports),
    "R15t": ("hostile text", names.in_documents),
    "soak": ("one process", soak.row),
}


def main() -> None:
    """Run rows, print the table, then a line per wrong thing and one that shows it."""
    parser = argparse.ArgumentParser(prog="python -m lab.audit", description=__doc__)
    parser.add_argument("rows", nargs="*", metavar="ROW", help=f"of {', '.join(ROWS)}")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    if unknown := [name for name in given.rows if name not in ROWS]:
        parser.error(f"no row {unknown[0]}; choose of {', '.join(ROWS)}")
    work = Path(tempfile.mkdtemp(prefix="toonset-audit-"))
    os.environ |= {"TOONSET_CACHE": str(work / "cache"), "TMPDIR": str(work)}
    import_everything()
    material = make_material(work, given.seed)
    wrong = 0
    print(f"{'id':5} {'tried':20} {'runs':>6} {'right':>6} {'wrong':>6} {'MB':>6} {'CPU s':>6}")
    for name in given.rows or ROWS:
        title, run = ROWS[name]
        began = time.monotonic()
        row = run(material)
        spent = time.monotonic() - began
        wrong += len(row.wrong)
        print(
            f"{name:5} {title:20} {row.tried:6} {row.tried - len(row.wrong):6} {len(row.wrong):6} "
            f"{row.peak_mb:6.0f} {row.cpu_s:6.1f}  {row.slowest} ({spent:.0f} s)",
            *[f"      {line}" for line in (row.note, *row.wrong) if line],
            sep="\n",
            flush=True,
        )
    if not wrong:
        shutil.rmtree(work)
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
