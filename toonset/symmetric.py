"""Define what an artist may say of a character's left and right."""

from __future__ import annotations

from typing import Literal, get_args

# auto: mirror images unless a drawing shows otherwise
Symmetric = Literal["auto", "on", "off"]
SYMMETRIC: tuple[Symmetric, ...] = get_args(Symmetric)
