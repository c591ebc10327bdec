"""Define a scene to train on: posed RGBA pictures, optionally labels and mannequin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

from toonset.camera import Camera
from toonset.mesh import Mesh
from toonset.options import Symmetric
from toonset.palette.palette import Shadow
from toonset.palette.pixels.ramp_labels import Ramp


@dataclass(frozen=True, eq=False)
class Frame:
    """One posed picture.

    Attributes:
        name: its file name, e.g. "000.png".
        camera: where it was taken from; `camera.size_wh` is the picture's size.
        rgba: (height, width, 4) sRGB with straight alpha.
        labels: (height, width) palette index per pixel, 255 = unlabelled; None without palette.
        mirrored: it is the mirror image of a drawing, nobody drew it.
    """

    name: str
    camera: Camera
    rgba: UInt8[np.ndarray, "height width 4"]
    labels: UInt8[np.ndarray, "height width"] | None = None
    mirrored: bool = False


@dataclass(frozen=True, eq=False)
class Scene:
    """Posed pictures of one character.

    Attributes:
        frames: in file order.
        palette: (colors, 3) sRGB that `Frame.labels` index; None without palette.
        name: where it came from, for messages.
        mannequin: as calibration fitted it, in the cameras' world; None: there is none.
        symmetric: whether the artist says that the sides are mirror images: "auto", "on" or "off".
        shadow: of drawings that are shaded in two tones; None: they are flat, or nobody looked.
        ramps: of the palette's colours, where the drawings are shaded throughout.
    """

    frames: tuple[Frame, ...]
    palette: UInt8[np.ndarray, "colors 3"] | None
    name: str
    mannequin: Mesh | None = None
    shadow: Shadow | None = None
    symmetric: Symmetric = "auto"
    ramps: tuple[Ramp, ...] = ()
