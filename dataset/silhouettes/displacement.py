"""Define families of displacements of a drawing, linear in few parameters.

A displacement says where a pixel's content comes from: corrected(x) = drawn(x + d(x)), all in
units of the figure's square (`Square`), so that it means the same at every size.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Float

CONTROLS = 8  # a side of the grid: shapes down to a fifth of a figure, 128 numbers a drawing
REACH = 0.2  # of the square: distance over which a hand's error changes


class Moves(Protocol):
    """A family of displacements of one drawing."""

    @property
    def covariance(self) -> Float[np.ndarray, "k k"]:
        """Return the numbers' covariance for displacements of about 1."""
        ...

    def jacobian(self, unit: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2 k"]:
        """Return the displacement per number at places of the square."""
        ...

    def at(
        self, unit: Float[np.ndarray, "n 2"], numbers: Float[np.ndarray, " k"]
    ) -> Float[np.ndarray, "n 2"]:
        """Return the displacements at places of the square."""
        ...

    def on_grid(
        self,
        across: Float[np.ndarray, " width"],
        down: Float[np.ndarray, " height"],
        numbers: Float[np.ndarray, " k"],
    ) -> Float[np.ndarray, "height width 2"]:
        """Return the displacements at every pair of places along the square's sides."""
        ...

    def even(self, shift: Float[np.ndarray, " 2"], growth: float) -> Float[np.ndarray, " k"]:
        """Return the numbers of shift + growth (2 unit - 1)."""
        ...


@dataclass(frozen=True, eq=False)
class ShiftAndScale:
    """Shift in x and y, and growth: the displacement at the square's edges."""

    covariance: Float[np.ndarray, "3 3"]

    @classmethod
    def expected(cls) -> ShiftAndScale:
        """Return the family; a size is drawn more surely than a place."""
        return cls(np.diag([1.0, 1.0, 0.25]))

    def jacobian(self, unit: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2 3"]:
        """Return the displacement per number."""
        result = np.zeros((len(unit), 2, 3))
        result[:, 0, 0] = result[:, 1, 1] = 1
        result[:, :, 2] = 2 * unit - 1
        return result

    def at(
        self, unit: Float[np.ndarray, "*n 2"], numbers: Float[np.ndarray, " 3"]
    ) -> Float[np.ndarray, "*n 2"]:
        """Return the displacements."""
        return numbers[:2] + numbers[2] * (2 * unit - 1)

    def on_grid(
        self,
        across: Float[np.ndarray, " width"],
        down: Float[np.ndarray, " height"],
        numbers: Float[np.ndarray, " 3"],
    ) -> Float[np.ndarray, "height width 2"]:
        """Return `at` of the grid's places."""
        return self.at(np.stack(np.meshgrid(across, down), axis=-1), numbers)

    def even(self, shift: Float[np.ndarray, " 2"], growth: float) -> Float[np.ndarray, " 3"]:
        """Return the numbers of shift + growth (2 unit - 1)."""
        return np.array([*shift, growth])


@dataclass(frozen=True, eq=False)
class Bends:
    """A cubic B-spline on CONTROLS x CONTROLS points; neighbours move alike.

    The numbers are the controls' x in rows of y, then their y. Their covariance is that of a
    smooth random field, exp(-distance^2 / 2 REACH^2).
    """

    covariance: Float[np.ndarray, "k k"]

    @classmethod
    def expected(cls) -> Bends:
        """Return the family."""
        places = _places()
        apart = ((places[:, None] - places[None]) ** 2).sum(axis=-1)
        field = np.exp(-apart / (2 * REACH**2)) + 1e-6 * np.eye(len(places))
        return cls(np.kron(np.eye(2), field))

    def jacobian(self, unit: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2 k"]:
        """Return the displacement per number."""
        scalar = _tensor_basis(unit)
        half = scalar.shape[1]
        result = np.zeros((len(unit), 2, 2 * half))
        result[:, 0, :half] = result[:, 1, half:] = scalar
        return result

    def at(
        self, unit: Float[np.ndarray, "n 2"], numbers: Float[np.ndarray, " k"]
    ) -> Float[np.ndarray, "n 2"]:
        """Return the displacements; beyond the square those of its edge."""
        return _tensor_basis(unit) @ numbers.reshape(2, -1).T

    def on_grid(
        self,
        across: Float[np.ndarray, " width"],
        down: Float[np.ndarray, " height"],
        numbers: Float[np.ndarray, " k"],
    ) -> Float[np.ndarray, "height width 2"]:
        """Return `at` of the grid's places, as a product of one basis per axis."""
        controls = numbers.reshape(2, CONTROLS, CONTROLS)
        return np.moveaxis(_cubic_basis(down) @ controls @ _cubic_basis(across).T, 0, -1)

    def even(self, shift: Float[np.ndarray, " 2"], growth: float) -> Float[np.ndarray, " k"]:
        """Return the numbers of shift + growth (2 unit - 1)."""
        return (shift + growth * (2 * _places() - 1)).T.reshape(-1)


def _places() -> Float[np.ndarray, "controls 2"]:
    """Return where the controls are; numbers linear in these make linear displacements."""
    line = (np.arange(CONTROLS) - 1) / (CONTROLS - 3)
    return np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)


def _tensor_basis(unit: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n controls"]:
    across, down = _cubic_basis(unit[:, 0]), _cubic_basis(unit[:, 1])
    return (down[:, :, None] * across[:, None, :]).reshape(len(unit), CONTROLS**2)


def _cubic_basis(unit: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n controls"]:
    """Return the uniform cubic B-splines' values on [0, 1]."""
    place = np.clip(unit, 0, 1) * (CONTROLS - 3)
    first = np.minimum(place.astype(int), CONTROLS - 4)
    t = place - first
    pieces = ((1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3)
    basis = np.zeros((len(unit), CONTROLS))
    for offset, piece in enumerate(pieces):
        basis[np.arange(len(unit)), first + offset] = piece / 6
    return basis
