"""List what lies in a folder, to tell whether anything has changed."""

import os
from hashlib import sha256
from pathlib import Path


def contents(folder: Path) -> dict[str, str]:
    """Return every path below a folder with what is there: hash, link target or kind."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_symlink():
            found[name] = f"link to {os.readlink(path)}"
        elif path.is_file():
            found[name] = sha256(path.read_bytes()).hexdigest()
        else:
            found[name] = "folder" if path.is_dir() else "special"
    return found
