"""toonset: character sheets to cameras, palettes and radiance fields."""

__version__ = "0.1.0"
