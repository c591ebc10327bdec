"""List the verbs in the order in which they are used, and find their functions."""

from __future__ import annotations

import importlib
import keyword
from collections.abc import Callable

VERBS = (
    *("split", "calibrate", "edit", "palette", "recolor", "train", "render", "view", "evaluate"),
    *("mesh", "consistency", "info", "check", "export", "import", "mannequin", "synth"),
    *("batch", "pack"),
)
# Where a verb shares a module:
MODULES = {
    "consistency": "evaluate",
    "edit": "web",
    "info": "check",
    "pack": "batch",
    "recolor": "palette",
    "view": "web",
}


def function_of(verb: str) -> Callable[..., None]:
    """Return the function of a verb, importing its module."""
    name = f"{verb}_" if keyword.iskeyword(verb) else verb
    module = importlib.import_module(f"toonset.cli.{MODULES.get(verb, name)}")
    found: Callable[..., None] = getattr(module, name)
    return found
