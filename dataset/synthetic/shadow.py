"""Shade a view in two tones with a light beside the camera, and vary its colours.

A pixel is in shadow where its surface's normal n and the direction l to the light, both in camera
axes, have n . l < LEAST_LIT; normals are smoothed a little, as a brush is wider than a facet.
Source: toon shading by a threshold on the normal, Lake et al. 2000.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.camera import Camera
from toonset.dataset.mesh.rasterize import depth_and_normals
from toonset.mesh import Mesh

TO_LIGHT = (-0.55, -0.55, -0.63)  # in camera axes, of length 1: from above, at the viewer's left
LEAST_LIT = 0.3
SOFT = 0.006  # of the body's height: deviation by which normals are smoothed
COOL = (1.0, 0.95, 0.8)  # of the strength, that red, green and blue lose

Rgb = UInt8[np.ndarray, "colors 3"]


def shadow_mask(mesh: Mesh, camera: Camera) -> Bool[np.ndarray, "height width"]:
    """Return which of a camera's pixels are in shadow; unspecified outside of the body."""
    depth, normals = depth_and_normals(mesh.vertices, mesh.faces, camera)
    there = np.isfinite(depth).astype(np.float32)
    lit = (normals @ np.array(TO_LIGHT)).astype(np.float32)
    sigma = SOFT * mesh.height * camera.scale
    lit, weight = (cv2.GaussianBlur(each, (0, 0), sigma) for each in (lit, there))
    return np.asarray(lit < LEAST_LIT * weight)


def shadow_factor(strength: float) -> Float[np.ndarray, " 3"]:
    """Return colours in shadow over those in light: red, green, blue."""
    return 1 - strength * np.array(COOL)


def color_factor(error: float, generator: np.random.Generator) -> Float[np.ndarray, " 3"]:
    """Return a view's colours over the character's: every channel is off by up to `error`."""
    return 1 + error * generator.uniform(-1, 1, 3)


def times(palette: Rgb, factor: Float[np.ndarray, " 3"]) -> Rgb:
    """Return the colours times a factor."""
    return np.rint(np.clip(palette * factor, 0, 255)).astype(np.uint8)
