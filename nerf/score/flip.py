"""Compute LDR-FLIP: the difference seen when flipping between two pictures, 0 to 1 per pixel.

Computed by the authors' package, flip-evaluator. It has no wheel for some machines (Linux on ARM);
there the figure is missing, with the reason.

Source: Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild, "FLIP: a difference
evaluator for alternating images", 2020.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

PIXELS_PER_DEGREE = 67.0  # the authors' default: a 0.7 m wide 4K screen from 0.7 m

FlipMap = Callable[[np.ndarray, np.ndarray], Float[np.ndarray, "height width"]]


def load_flip() -> FlipMap | str:
    """Return the function from (drawn, rendered) sRGB in [0, 1] to the error map, or why not."""
    try:
        package = importlib.import_module("flip_evaluator")
    except ImportError:
        return "the package flip-evaluator is not installed"

    def flip_map(drawn: np.ndarray, rendered: np.ndarray) -> Float[np.ndarray, "height width"]:
        reference, test = (np.ascontiguousarray(p, dtype=np.float32) for p in (drawn, rendered))
        settings = {"ppd": PIXELS_PER_DEGREE}
        error, _, _ = package.evaluate(reference, test, "LDR", True, False, False, settings)
        return np.asarray(error, dtype=np.float64)[..., 0]

    return flip_map
