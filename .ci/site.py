"""Pages of the site that are not in docs/: a hook of mkdocs.yml.

The README is the home page, so that what people read first is written once. Links from the root to
docs/ become links within the site; what is no page (a folder, a licence) becomes plain text. Of the
notebooks the site has words and code; they are committed without results.
"""

import json
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
    """Add the documents of the root, and the notebooks, to the site's files."""
    for document, page in PAGES.items():
        text = (ROOT / document).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=linked(text)))
    for notebook in sorted(ROOT.glob("examples/*.ipynb")):
        page = f"notebook_{notebook.stem}.md"
        files.append(File.generated(config, page, content=shown(notebook)))
    files.append(File.generated(config, "wide.css", content=WIDE))
    return files


def shown(notebook: Path) -> str:
    """Return a notebook as a page, with its place below the title."""
    parts = []
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        text = "".join(cell["source"])
        parts.append(f"```python\n{text}\n```" if cell["cell_type"] == "code" else text)
    title, rest = "\n\n".join(parts).split("\n", 1)
    return f"{title}\n\nThe notebook `{notebook.relative_to(ROOT)}`.\n{rest}\n"


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
