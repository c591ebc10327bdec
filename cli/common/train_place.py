"""Where `toonset train` writes: RUN when it is done, RUN.unfinished until then.

RUN.unfinished holds the last checkpoint and preview of a training that goes on or was cut short;
a finished RUN is never touched before the next one is whole.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from toonset.errors import BundleError, OutputError
from toonset.write import check_output

if TYPE_CHECKING:
    from toonset.nerf.run.checkpoint import Checkpoint

CHECKPOINT = "checkpoint.json"
BESIDE = (CHECKPOINT, "checkpoint-*.safetensors", ".*.tmp")  # in an unfinished run


@dataclass(frozen=True)
class Place:
    """Where a run is written.

    Attributes:
        run: when it is done.
        force: replace earlier ones.
    """

    run: Path
    force: bool

    @property
    def unfinished(self) -> Path:
        """Return where it is until then."""
        return self.run.with_name(f"{self.run.name}.unfinished")

    def check(self, inputs: Sequence[Path | None], *, resume: bool) -> None:
        """Refuse, before any work, what must not be replaced.

        Raises:
            OutputError: one of the folders holds something to keep.
            BundleError: there is nothing to resume.
        """
        from toonset.nerf.run.manifest import WRITTEN

        check_output(self.run, inputs, WRITTEN, force=self.force)
        kept = (self.unfinished / CHECKPOINT).is_file()
        if resume and not kept:
            raise BundleError(
                f"{self.unfinished}: holds no {CHECKPOINT}, so there is nothing to resume; train "
                "without --resume"
            )
        if kept and not resume and not self.force:
            raise OutputError(
                f"{self.unfinished}: holds an unfinished training; go on with --resume, or begin "
                "anew with --force"
            )
        check_output(self.unfinished, inputs, (*WRITTEN, *BESIDE), force=True)

    def clear(self) -> None:
        """Remove what is left of an unfinished training; `check` has looked into it."""
        shutil.rmtree(self.unfinished, ignore_errors=True)

    def checkpoint(self) -> Checkpoint:
        """Return the unfinished training.

        Raises:
            BundleError: it is damaged, or of another toonset.
        """
        from toonset.nerf.run.checkpoint import read_checkpoint

        return read_checkpoint(self.unfinished)
