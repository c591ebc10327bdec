"""Whatever fails while a verb writes, and whenever it is killed: the old output or the new one."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc/self/fd")


def tried(*arguments: str) -> int:
    """Run the faults; return how many there were, all of them survived."""
    command = [sys.executable, "-m", "lab.faults", *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    found = re.search(r"^all: (\d+) tried, 0 wrong", done.stdout, re.MULTILINE)
    assert done.returncode == 0, done.stdout[-5000:] + done.stderr[-2000:]
    assert found is not None
    return int(found[1])


def test_every_call_of_a_verb_may_fail() -> None:
    assert tried("split", "palette-again", "train", "--quick") > 600


@pytest.mark.slow
def test_every_call_of_every_verb_may_fail_in_every_way_and_at_any_time() -> None:
    assert tried("--kills", "20", "--rounds", "20", "--signals", "4") > 2000
