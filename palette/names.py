"""Plain names for colours, so that people can talk about a palette."""

from __future__ import annotations

import numpy as np

from toonset.palette.colors import oklab_from_rgb

NAMED = {
    "black": (14, 14, 14),
    "charcoal": (54, 57, 63),
    "dark charcoal": (42, 43, 45),
    "dark grey": (90, 90, 90),
    "grey": (136, 136, 136),
    "light grey": (195, 195, 195),
    "white": (255, 255, 255),
    "cream": (250, 240, 205),
    "beige": (220, 196, 160),
    "tan": (190, 150, 105),
    "skin": (236, 188, 155),
    "brown": (125, 78, 45),
    "dark brown": (66, 42, 28),
    "dark purple": (44, 28, 56),
    "dark teal": (22, 62, 66),
    "dark blue": (24, 28, 58),
    "rust": (170, 75, 35),
    "orange": (245, 135, 30),
    "peach": (255, 200, 165),
    "gold": (225, 170, 50),
    "mustard": (180, 145, 40),
    "yellow": (250, 220, 50),
    "pale yellow": (255, 245, 160),
    "lime": (165, 215, 50),
    "green": (50, 155, 60),
    "dark green": (25, 80, 40),
    "olive": (110, 110, 45),
    "mint": (160, 225, 190),
    "sage": (140, 160, 125),
    "teal": (25, 130, 130),
    "turquoise": (65, 200, 195),
    "sky blue": (125, 195, 240),
    "light blue": (175, 210, 235),
    "blue": (40, 100, 215),
    "royal blue": (25, 65, 185),
    "slate blue": (90, 110, 150),
    "navy": (36, 48, 98),
    "indigo": (70, 50, 150),
    "violet": (135, 75, 195),
    "purple": (110, 40, 120),
    "lavender": (195, 180, 230),
    "magenta": (205, 45, 150),
    "pink": (245, 150, 185),
    "rose": (215, 95, 120),
    "red": (215, 40, 40),
    "dark red": (125, 20, 25),
    "coral": (250, 120, 95),
}
_NAMES = tuple(NAMED)
_PLACES = oklab_from_rgb(np.array(list(NAMED.values()), dtype=np.uint8))


def name_of(rgb: tuple[int, int, int]) -> str:
    """Return the nearest plain name, e.g. "dark green", of an 8-bit sRGB colour."""
    place = oklab_from_rgb(np.array(rgb, dtype=np.uint8))
    return _NAMES[int(np.linalg.norm(_PLACES - place, axis=1).argmin())]


def hex_of(rgb: tuple[int, int, int]) -> str:
    """Return "#rrggbb" of an 8-bit sRGB colour."""
    return "#{:02x}{:02x}{:02x}".format(*rgb)
