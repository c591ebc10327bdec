"""Read JSON files strictly, and validate them against a schema.

A file says what it is in `schema` (see `toonset.read`): readers ignore keys that they do not
know, for later versions may add some. A camera is the exception: a number more could change where
it looks, so its keys must all be known.

A dataclass whose fields are annotated with what a file may hold is its own record: it is a field of
the file's, and pydantic reads and writes it.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from toonset.errors import BundleError, one_line
from toonset.read import parse_json, read_whole

MAX_JSON_BYTES = 32 * 2**20
MOST_PROBLEMS = 20  # of one file; the rest is counted
# Of a file that a person writes: a key that is not known is a slip
STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

LARGEST = 1e9  # world units, pixels, and pixels per unit either way: float32 still tells
Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Size = Annotated[float, Field(ge=1 / LARGEST, le=LARGEST)]
Share = Annotated[float, Field(ge=0, le=1)]
Byte = Annotated[int, Field(ge=0, le=255)]

Record = TypeVar("Record", bound=BaseModel)


class SchemaProblems(BundleError):
    """A file that does not fit its schema.

    Attributes:
        problems: where in the file and what, one line each, the first 20 in words.
    """

    def __init__(self, file: Path, error: ValidationError) -> None:
        """Say the first problem and how many there are; keep all."""
        problems = _problems(error, MOST_PROBLEMS)
        more = error.error_count() - len(problems)
        self.problems = [*problems, f"and {more} more problems like these"] if more else problems
        super().__init__(f"{file}: {validation_reason(error)}")


def read_json(file: Path) -> Any:
    """Return the content of a JSON file of bounded size.

    Raises:
        BundleError: the file cannot be read, is too large, or is not JSON (see
            `toonset.read`).
    """
    data = read_whole(file, "JSON", BundleError, MAX_JSON_BYTES)
    return parse_json(data, str(file), BundleError)


def validate(schema: type[Record], content: Any, file: Path) -> Record:
    """Return the content of a file as its schema has it.

    Raises:
        SchemaProblems: it does not fit.
    """
    try:
        return schema.model_validate(content)
    except ValidationError as error:
        raise SchemaProblems(file, error) from error


def validation_reason(error: ValidationError) -> str:
    """Return where and what the first problem of a schema check is."""
    more = error.error_count() - 1
    also = f" (and {more} more problem{'s' * (more > 1)})" if more else ""
    return f"{_problems(error, 1)[0]}{also}; correct the file"


def _problems(error: ValidationError, most: int) -> list[str]:
    found = error.errors(include_url=False, include_context=False, include_input=False)
    return [_problem(tuple(one["loc"]), one["msg"]) for one in found[:most]]


def _problem(path: tuple[object, ...], message: str) -> str:
    place = ".".join(str(part)[:60] for part in path)
    plain = re.sub(r" or (an )?instance of \w+| after validation|^Value error, ", "", message)
    plain = re.sub("tuple|array", "list", plain.replace("Tuple", "List"))
    if plain == "Unexpected keyword argument":  # of a dataclass
        plain = "Extra inputs are not permitted"
    return one_line(f"field {place}: {plain}" if place else f"the whole: {plain}")
