"""Shade a view with a light beside the camera, in two tones or softly, and vary its colours.

n is the surface's normal and l the direction to the light, both in camera axes. In two tones, a
pixel is in shadow where n . l < LEAST_LIT; normals are smoothed a little, as a brush is wider than
a facet. A painter's soft shade is

    (1 - light (1 - n . l) / 2) (1 - hollow h) (1 + stroke noise)

where h is how far a pixel lies behind the mean depth around it, as a share of `DEEP`; red loses
light first. Sources: toon shading by a threshold on the normal, Lake et al. 2000; half-Lambert
shading, Mitchell and others, "Illustrative rendering in Team Fortress 2" (2007); hollows, Luft and
others, "Image enhancement by unsharp masking the depth buffer" (2006).
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float32, UInt8

from toonset.camera import Camera
from toonset.dataset.mesh.rasterize import depth_and_normals
from toonset.dataset.synthetic.artist_options import Brushwork
from toonset.mesh import Mesh

TO_LIGHT = (-0.55, -0.55, -0.63)  # in camera axes, of length 1: from above, at the viewer's left
LEAST_LIT = 0.3
SOFT = 0.006  # of the body's height: deviation by which normals are smoothed
COOL = (1.0, 0.95, 0.8)  # of the strength, that red, green and blue lose

SMOOTH, AROUND = 0.015, 0.04  # of the body's height: deviations that smooth normals, and depth
DEEP = 0.06  # of the body's height: a hollow so deep is wholly one
STROKE = 0.008, 0.03  # of the body's height: deviations of fine and of broad strokes
COOLER = (1.1, 1.0, 0.85)  # powers of the shade, by red, green and blue
DARKEST, LIGHTEST = 0.05, 1.3

Shade = Float32[np.ndarray, "height width"]
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


def soft_shade(
    mesh: Mesh, camera: Camera, brush: Brushwork, generator: np.random.Generator
) -> Shade:
    """Return how light every pixel is painted, of its colour in full light.

    Args:
        mesh: what is drawn.
        camera: of the cell.
        brush: sizes.
        generator: asked for the same number of draws, whatever the sizes.
    """
    depth, normals = depth_and_normals(mesh.vertices, mesh.faces, camera)
    there = np.isfinite(depth)
    weight = there.astype(np.float32)
    unit = mesh.height * camera.scale
    lit = _mean((normals @ np.array(TO_LIGHT)).astype(np.float32), weight, SMOOTH * unit)
    near = np.where(there, depth, 0).astype(np.float32)
    behind = (near - _mean(near, weight, AROUND * unit)) / (DEEP * mesh.height)
    fine, broad = (_noise(generator, there.shape, deviation * unit) for deviation in STROKE)
    shade = 1 - brush.soft_light * (1 - lit.clip(-1, 1)) / 2
    shade *= 1 - brush.hollows * behind.clip(0, 1)
    shade *= 1 + brush.strokes * (fine + broad) / np.sqrt(2)
    return np.where(there, shade, 1).clip(DARKEST, LIGHTEST).astype(np.float32)


def shaded(
    colors: Float[np.ndarray, "height width 3"], shade: Shade
) -> Float[np.ndarray, "height width 3"]:
    """Return colours, 0 to 255, as light as the shade says."""
    tint = np.stack([shade**power for power in COOLER], axis=-1)
    return (colors * tint).clip(0, 255)


def _mean(values: Shade, weight: Shade, sigma: float) -> Shade:
    total, mass = (
        cv2.GaussianBlur(each, (0, 0), max(sigma, 0.3)) for each in (values * weight, weight)
    )
    return np.asarray(total / np.maximum(mass, 1e-6))


def _noise(generator: np.random.Generator, shape: tuple[int, ...], sigma: float) -> Shade:
    """Return smooth noise of deviation 1."""
    noise = generator.standard_normal(shape).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), max(sigma, 0.3))
    return np.asarray(smooth / max(float(smooth.std()), 1e-6))
