"""What the documents say is there: commands, rooms, files and links between them."""

import re
import shlex
from pathlib import Path

import pytest
import typer.main

import toonset as ts
from tests.test_layers import FLOORS, folders

ROOT = Path(__file__).resolve().parents[1]
RUN_COMMANDS = {"demo", "test", "lint", "docs", "wheel"}  # what ./run knows beyond toonset's verbs
DOCUMENTS = [
    "README.md",
    "CONTRIBUTING.md",
    *(f"docs/{p.name}" for p in (ROOT / "docs").glob("*.md")),
]
LONGEST_README = 150  # lines: one page


def text_of(document: str) -> str:
    return (ROOT / document).read_text(encoding="utf-8")


def shown_commands(document: str) -> list[list[str]]:
    """Return each `./run ...` or `toonset ...` line of the ```sh blocks, split into words."""
    blocks = re.findall(r"^```sh\n(.*?)^```", text_of(document), re.MULTILINE | re.DOTALL)
    lines = "".join(blocks).replace("\\\n", " ").splitlines()
    words = [shlex.split(line.removeprefix("$ "), comments=True) for line in lines]
    return [line[1:] for line in words if line and line[0] in {"./run", "toonset"}]


def steps_of_the_demo() -> list[list[str]]:
    text = (ROOT / "run").read_text(encoding="utf-8")
    return [shlex.split(line)[1:] for line in re.findall(r"^ +(step [a-z].*)$", text, re.MULTILINE)]


def complaint(words: list[str]) -> str:
    """Return what toonset, or the bench, would not understand in a command line; empty if fine."""
    from lab.bench.__main__ import app as bench
    from toonset.cli.common.verbs import VERBS
    from toonset.cli.main import app

    verb = next((word for word in words if not word.startswith("-")), None)
    if verb is None or verb in RUN_COMMANDS:
        return ""
    if verb not in (*VERBS, "bench"):
        return f"no verb {verb}"
    if verb == "bench":
        command = typer.main.get_command(bench)
    else:
        command = typer.main.get_group(app).commands[verb]
    known = {name for parameter in command.params for name in parameter.opts} | {"-h", "--help"}
    known |= {name for parameter in command.params for name in parameter.secondary_opts}
    used = {word.split("=")[0] for word in words if re.match(r"--?[a-z]", word)}
    unknown = sorted(used - known)
    return f"{verb}: no option {', '.join(unknown)}" if unknown else ""


@pytest.mark.parametrize("document", DOCUMENTS)
def test_shown_commands_exist(document: str) -> None:
    commands = shown_commands(document)
    assert commands or document.startswith("docs/")
    assert [c for words in commands if (c := complaint(words))] == []


def test_demo_commands_exist() -> None:
    steps = steps_of_the_demo()
    assert [words[0] for words in steps] == ["calibrate", "palette", "train", "view", "render"]
    assert [c for words in steps if (c := complaint(words))] == []


@pytest.mark.parametrize("words", [["paint", "x.png"], ["calibrate", "x.png", "--mush", "m.obj"]])
def test_wrong_commands_are_seen(words: list[str]) -> None:
    assert complaint(words)


def test_readme_is_one_page() -> None:
    assert len(text_of("README.md").splitlines()) <= LONGEST_README


@pytest.mark.parametrize("document", DOCUMENTS)
def test_no_placeholder_is_left(document: str) -> None:
    assert not re.search(r"@[A-Z]+@", text_of(document))


@pytest.mark.parametrize("document", DOCUMENTS)
def test_links_lead_somewhere(document: str) -> None:
    links = re.findall(r"\]\(([^)#]+)\)|src=\"([^\"]+)\"", text_of(document))
    places = [one or other for one, other in links if "://" not in one + other]
    assert [p for p in places if not (ROOT / document).parent.joinpath(p).exists()] == []


def test_api_reference_has_every_public_name() -> None:
    shown = re.findall(r"^::: toonset\.([\w.]+)", text_of("docs/api.md"), re.MULTILINE)
    public = [entry for names in ts._PLACES.values() for entry in names.split()]
    renamed = {there or name for name, _, there in (entry.partition("=") for entry in public)}
    names = [place.split(".")[-1] for place in shown]
    assert renamed <= set(names)
    assert len(names) == len(set(names))


def test_site_lists_every_document_once() -> None:
    shown = re.findall(r"^ +- (\w+\.md)$", text_of("mkdocs.yml"), re.MULTILINE)
    made = ["changelog.md", "contributing.md", "index.md"]  # by .ci/site.py
    made += [f"notebook_{path.stem}.md" for path in ROOT.glob("examples/*.ipynb")]
    assert sorted(shown) == sorted([*made, *(p.name for p in (ROOT / "docs").glob("*.md"))])


@pytest.mark.parametrize("document", sorted({*DOCUMENTS} - {"docs/formats.md"}))
def test_named_sources_are_there(document: str) -> None:
    """`room/file.py` is a path from the root; `file.py` is beside one named in its section."""
    missing = []
    for section in re.split(r"^## ", text_of(document), flags=re.MULTILINE):
        names = re.findall(r"`([\w/]+\.py)`", section)
        rooms = {(ROOT / name).parent for name in names if "/" in name}
        for name in names:
            places = {ROOT} if "/" in name else rooms
            missing += [] if any((place / name).is_file() for place in places) else [name]
    assert not missing


def test_architecture_lists_every_room_and_floor() -> None:
    text = text_of("docs/architecture.md")
    rooms = {f"{folder.relative_to(ROOT)}/" for folder in folders()}
    assert rooms <= set(re.findall(r"^\| `([\w/]+/)`", text, re.MULTILINE))
    table = text[text.index("| palette | dataset |") :].split("\n\n")[0].splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table[2:]]
    stages = [cell.strip() for cell in table[0].strip("|").split("|")]
    for column, stage in enumerate(stages):
        shown = [row[column] for row in rows if row[column]]
        told = [floor.replace(".", "/") for floor in FLOORS[stage]]
        assert [sorted(line.split(", ")) for line in shown] == [sorted(f.split()) for f in told]
