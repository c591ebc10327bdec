"""The command line, with sheets that crash or hang their worker: those that are called so."""

import os
import signal
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from toonset.cli.common import verb_stages

WELL_BEHAVED = verb_stages.VERBS


def run(
    stage: str, words: Sequence[str], sheets: Sequence[str], home: Path
) -> tuple[int, dict[str, Any]]:
    """Run a stage, or do what the sheet's name says."""
    if home.name.startswith("crash"):
        os.kill(os.getpid(), signal.SIGSEGV)
    if home.name.startswith("hang"):
        time.sleep(1e6)
    ran = WELL_BEHAVED.run(stage, words, sheets, home)
    with open(home.parents[1] / "completed", "a") as file:
        file.write(f"{home.name} {stage}\n")
    return ran


if __name__ == "__main__":
    from lab.kills import child  # so that Ray's processes find it by its name
    from toonset.cli.main import main

    verb_stages.VERBS = replace(WELL_BEHAVED, run=child.run)
    main()
