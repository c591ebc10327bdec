"""What shells are told when a user presses the tab key: no shell is needed, only its protocol."""

from collections.abc import Callable
from typing import Any

import pytest

from toonset.cli.common.verbs import VERBS

SHELLS = ("bash", "zsh", "fish")


def ask(shell: str, line: str, toonset: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> str:
    """Return what a shell is given for a line that ends where the cursor is."""
    monkeypatch.setenv("_TOONSET_COMPLETE", f"complete_{shell}")
    if shell == "bash":
        monkeypatch.setenv("COMP_WORDS", line)
        monkeypatch.setenv("COMP_CWORD", str(len(line.split()) - (not line.endswith(" "))))
    else:
        monkeypatch.setenv("_TYPER_COMPLETE_ARGS", line)
        monkeypatch.setenv("_TYPER_COMPLETE_FISH_ACTION", "get-args")
    done = toonset()
    assert (done.code, done.err) == (0, "")
    return done.out


@pytest.fixture(params=SHELLS)
def completed(
    request: pytest.FixtureRequest, toonset: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> Callable[[str], set[str]]:
    """Return the words that a shell offers for a line."""

    def words(line: str) -> set[str]:
        said = ask(request.param, line, toonset, monkeypatch)
        if request.param == "zsh":  # _arguments '*: :(("word":"help" and more))'
            said = said.removeprefix("_arguments '*: :((").removesuffix("))'\n").replace('"', "")
        end = {"bash": None, "zsh": ":", "fish": "\t"}[request.param]
        return {row.split(end)[0] if end else row for row in said.splitlines()}

    return words


def test_zsh_completes_at_the_first_tab_too(
    toonset: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It runs the script then, as a function: what only registers another one completes nothing."""
    monkeypatch.setenv("_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION", "1")
    lines = toonset("--show-completion", "zsh").out.split("\n")
    loaded = lines.index("if [[ $zsh_eval_context[-1] == loadautofunc ]]; then")
    assert loaded > lines.index("compdef _toonset_completion toonset")
    assert lines[loaded + 1].split() == ["_toonset_completion", '"$@"']


def test_verbs_are_completed(completed: Callable[[str], set[str]]) -> None:
    assert set(VERBS) <= completed("toonset ")
    assert completed("toonset ca") == {"calibrate"}
    assert completed("toonset help tr") == {"train"}


def test_options_are_completed(completed: Callable[[str], set[str]]) -> None:
    assert {"--mesh", "--views", "--force"} <= completed("toonset calibrate sheet.png --")
    steps = ("mannequin", "palette", "register", "unwarp", "fairing")
    assert completed("toonset train --no-") == {f"--no-{step}" for step in steps}


@pytest.mark.parametrize(
    ("line", "choices"),
    [
        ("batch --stages calibrate,p", {"calibrate,palette"}),
        ("batch --stages r", {"render"}),
        ("export bundle --to b", {"blender", "blender-addon", "blender-synthetic"}),
        ("export bundle --to colmap --layout ", {"new", "old"}),
        ("render run --layer normal", {"normal", "normal-camera"}),
        ("render run --format webp,s", {"webp,sprites", "webp,svg"}),
        ("train --field tri", {"triplane"}),
        ("train --preset ", {"fast", "paper"}),
        ("train --device c", {"cpu", "cuda"}),
        ("palette --space ", {"rgb", "oklab"}),
        ("calibrate sheet.png --lock e", {"elevation"}),
        ("import folder --up ", {"y", "z"}),
        ("mannequin --pose r", {"relaxed"}),
        ("synth mesh.glb --condition a", {"artist"}),
    ],
)
def test_choices_are_completed(line, choices, completed):
    assert completed(f"toonset {line}") == choices
