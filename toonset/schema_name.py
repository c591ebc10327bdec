"""What a JSON file says that it is: "NAME/MAJOR", or "NAME/MAJOR.MINOR", under `schema`.

Within a major version keys may be added, never changed or taken away; a reader takes any minor one.
"""

from __future__ import annotations

import re
from typing import Any

from toonset.errors import ToonsetError


def schema_version(
    content: Any, name: str, newest: int, where: str, error_type: type[ToonsetError]
) -> int | None:
    """Return the major version that a file's `schema` states, None where it states none.

    Args:
        content: of the file.
        name: of the schema that is meant, e.g. "toonset-calibration".
        newest: the highest major version that is understood.
        where: the file, for messages.
        error_type: the error to raise.

    Raises:
        ToonsetError: as `error_type`: another schema, or one of a newer toonset.
    """
    stated = content.get("schema") if isinstance(content, dict) else None
    if stated is None:
        return None
    match = re.fullmatch(rf"{name}/([1-9]\d{{0,3}})(\.\d{{1,4}})?", str(stated), re.ASCII)
    if match is None:
        raise error_type(
            f"{where}: schema {str(stated)[:60]!r}, '{name}/{newest}' is needed; write it again"
        )
    major = int(match[1])
    if major > newest:
        raise error_type(
            f"{where}: schema '{match[0]}' is newer than this toonset, which reads up to "
            f"'{name}/{newest}'; update toonset"
        )
    return major
