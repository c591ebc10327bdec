"""Show what options are for on the site: an extension of mkdocs.yml's mkdocstrings.

The documentation of a class that is `described` is put together when it is imported.
"""

import importlib
import inspect
from typing import Any

import griffe


class Described(griffe.Extension):
    """Read the documentation of options from the classes themselves."""

    def on_class_members(self, *, cls: griffe.Class, **kwargs: Any) -> None:
        """Take it over where a class has the decorator."""
        names = [str(one.value).rpartition(".")[2] for one in cls.decorators]
        if cls.docstring is not None and "described" in names:
            module = importlib.import_module(cls.module.path)
            cls.docstring.value = inspect.getdoc(getattr(module, cls.name)) or ""
            for one in cls.attributes.values():
                one.annotation = _plain(one.annotation)


def _plain(annotation: Any) -> Any:
    """Return a type without what it is for."""
    if isinstance(annotation, griffe.ExprSubscript) and str(annotation.left) == "Annotated":
        return annotation.slice.elements[0]
    return annotation
