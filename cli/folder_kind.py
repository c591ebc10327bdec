"""What a path is that `info` and `check` are given."""

from __future__ import annotations

from pathlib import Path

from toonset.errors import BundleError

RUN, SPLIT, CAMERAS = "run", "split", "cameras"
MARKS = ((RUN, "config.json"), (RUN, "model.safetensors"), (SPLIT, "split.json"))


def kind_of(path: Path) -> str:
    """Return "cameras" (a bundle or any transforms.json), "run" or "split".

    Raises:
        BundleError: it is none of them.
    """
    from toonset.dataset.bundle.transforms_read import NAMES
    from toonset.dataset.images.folder import ENDINGS

    if not path.exists():
        raise BundleError(f"{path}: does not exist; name a bundle, a run or a split folder")
    if path.suffix.lower() in ENDINGS:
        raise BundleError(
            f"{path}: is a picture; name a folder that `toonset split` or `calibrate` has written"
        )
    if not path.is_dir():
        return CAMERAS
    if any((path / name).is_file() for name in NAMES):
        return CAMERAS
    kind = next((kind for kind, name in MARKS if (path / name).is_file()), None)
    if kind is None:
        raise BundleError(
            f"{path}: holds no transforms.json, split.json or config.json; name a folder that "
            "`toonset calibrate`, `split` or `train` has written (`toonset import` reads others)"
        )
    return kind
