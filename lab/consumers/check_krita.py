"""Check that Krita shows `turntable.ora` as toonset does, and keeps its groups.

    apt-get install krita xvfb
    toonset render RUN --turntable 5 --format ora -o layers
    xvfb-run -a python lab/consumers/check_krita.py layers

Measured with Krita 5.1.5: 66 and 62 dB over white from the pictures of two characters (the layers'
own, 3 of 255 levels at most), alpha the same, names, places and hidden groups kept. Debian's GIMP
2.10.34 does not know the format: its plug-in needs Python 2.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from PIL import Image

LEAST_DB = 45.0
KEPT = ("name", "visibility", "x", "y")  # of groups and layers


def exported(source: Path, target: Path) -> Path:
    """Return what Krita makes of a file."""
    line = ["krita", "--export", "--export-filename", str(target), str(source)]
    subprocess.run(line, check=True, capture_output=True, timeout=300)
    return target


def over_white(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        rgba = np.array(image.convert("RGBA")) / 255
    return np.asarray(rgba[..., :3] * rgba[..., 3:] + 1 - rgba[..., 3:])


def stack_of(path: Path) -> list[dict[str, str]]:
    """Return groups and layers; a shown group at the origin says nothing of it."""
    usual = {"visibility": "visible", "x": "0", "y": "0"}
    with zipfile.ZipFile(path) as file:
        [stack] = ElementTree.fromstring(file.read("stack.xml"))
    parts = [part for part in stack.iter() if part is not stack]
    return [{key: part.get(key, usual.get(key, "")) for key in KEPT} for part in parts]


def main(folder: Path) -> None:
    source = folder / "turntable.ora"
    with tempfile.TemporaryDirectory() as place:
        flat = exported(source, Path(place) / "flat.png")
        off = over_white(flat) - over_white(folder / "000.png")
        again = stack_of(exported(source, Path(place) / "again.ora"))
    likeness = float(-10 * np.log10(np.square(off).mean() + 1e-12))
    print(f"{source}: {likeness:.1f} dB, {255 * np.abs(off).max():.1f} levels at most")
    assert likeness >= LEAST_DB
    assert again == stack_of(source), "groups or layers differ"


if __name__ == "__main__":
    main(Path(sys.argv[1]))
