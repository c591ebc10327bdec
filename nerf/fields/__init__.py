"""Radiance fields: triplane, and what it is compared with."""
