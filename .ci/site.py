"""Pages of the site that are not in docs/: a hook of mkdocs.yml.

The README is the home page, so that what people read first is written once. Links from the root to
docs/ become links within the site; what is no page (a folder, a licence) becomes plain text.
"""

import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[1]
PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
}
WIDE = ".md-grid { max-width: 76rem }"  # code has lines of 100


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the documents of the root to the site's files."""
    for document, page in PAGES.items():
        text = (ROOT / document).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=linked(text)))
    files.append(File.generated(config, "wide.css", content=WIDE))
    return files


def linked(text: str) -> str:
    """Return a document of the root with links as they are seen from docs/."""

    def markdown(found: re.Match[str]) -> str:
        words, place = found.groups()
        seen = seen_from_docs(place)
        return words if seen is None else f"[{words}]({seen})"

    text = re.sub(r"(?<!!)\[([^\]]*)\]\(([^)\s]+)\)", markdown, text)
    return re.sub(r"(\]\(|src=\")docs/", r"\1", text)  # pictures


def seen_from_docs(place: str) -> str | None:
    """Return a link of the root as docs/ has it; None where it is no page of the site."""
    if "://" in place or place.startswith("#"):
        return place
    name = place.partition("#")[0]
    if name.startswith("docs/"):
        return place.removeprefix("docs/")
    return PAGES.get(name)
