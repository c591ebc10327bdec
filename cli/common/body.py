"""Read what `--mesh` names: a mannequin, or that there is none."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from toonset.options import Body

if TYPE_CHECKING:
    from toonset.mesh import Mesh, Up


def is_no_body(mesh: Path | None) -> bool:
    """Return whether `--mesh` says that there is no body."""
    return str(mesh) == Body.NONE.value


def body_of(mesh: Path | None, up: Up) -> Mesh | Body:
    """Return the mannequin that `--mesh` names, or what stands in for it."""
    from toonset.dataset.mesh.load import load_mesh

    if mesh is None:
        return Body.DEFAULT
    return Body.NONE if is_no_body(mesh) else load_mesh(mesh, up=up)
