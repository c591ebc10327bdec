"""Where the cameras of a calibration come from: options, seed, versions, hashes of the inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from toonset.cli.common.calibrate_inputs import Body, Hints


def provenance(
    drawings: Sequence[tuple[str, Path]], body: Body, hints: Hints, seed: int
) -> dict[str, Any]:
    """Return what calibration.json says of where its cameras come from.

    Args:
        drawings: role and path of every file that the views depend on.
        body: the mannequin.
        hints: what the command line says of the views.
        seed: of everything random.
    """
    from hashlib import sha256
    from importlib.metadata import version

    from toonset.calib.options import CalibrationOptions

    packages = ("toonset", "numpy", "scipy", "opencv-contrib-python-headless")
    return {
        "options": asdict(CalibrationOptions()) | hints.as_options() | body.as_options(),
        "seed": seed,
        "versions": {name: version(name) for name in packages},
        "inputs": [  # views may come from files of the same name in several folders
            {"name": path.name, "sha256": sha256(path.read_bytes()).hexdigest(), "role": role}
            for role, path in _files(drawings, body, hints)
        ],
    }


def _files(
    drawings: Sequence[tuple[str, Path]], body: Body, hints: Hints
) -> list[tuple[str, Path]]:
    """Return (role, path) of every file that the cameras depend on."""
    from toonset.dataset.bundle.transforms import transforms_file
    from toonset.dataset.mannequin.files import landmarks_path

    files = list(drawings)
    if body.path is not None:
        files.append(("mesh", body.path))
    if hints.landmarks is not None:
        files.append(("landmarks", hints.landmarks))
        if body.path is not None and landmarks_path(body.path).exists():
            files.append(("points of the mesh", landmarks_path(body.path)))
    if hints.init is not None:
        files.append(("init", transforms_file(hints.init)))
    return files
