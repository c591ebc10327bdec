"""Suggest what a mistyped word was meant to be."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


def did_you_mean(word: str, choices: Iterable[str]) -> str:
    """Return "did you mean 'front'?" with the nearest choice; "" if none is near."""
    near = get_close_matches(word, list(choices), 1)
    return f"did you mean {near[0]!r}?" if near else ""
