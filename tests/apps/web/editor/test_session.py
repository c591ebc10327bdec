"""A bundle that is corrected: what is kept, what is fitted, what is left when all ends at once."""

import json
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from lab.bench.messy.sheet import make_messy_sheet
from toonset.apps.web.editor import opening, refit
from toonset.apps.web.editor import session as session_module
from toonset.apps.web.editor.opening import folder_of, open_session
from toonset.apps.web.editor.refit import CORRECTIONS, Changed, Subject, parts_changed
from toonset.apps.web.editor.scene import PALETTE, for_page, scene_of
from toonset.apps.web.editor.session import Session, StaleError
from toonset.calib.without_body.judge import ASK
from toonset.dataset.bundle.bundle import read_bundle
from toonset.dataset.bundle.calibration_schema import CalibrationFile
from toonset.dataset.bundle.check import bundle_problems
from toonset.dataset.images.picture import encode_png
from toonset.dataset.split_folder.load import split_sheet
from toonset.dataset.split_folder.options import SheetOptions
from toonset.errors import BundleError, SheetError, ToonsetError
from toonset.options import Body

Command = Any
Outcome = Any


@pytest.fixture
def bundle(drawn: Path, calibrated: tuple[Path, Outcome], tmp_path: Path) -> Path:
    """Return a bundle of five views beside its sheet and mannequin."""
    for name in ("sheet.png", "mannequin.obj"):
        shutil.copy(drawn / name, tmp_path / name)
    return Path(shutil.copytree(calibrated[0], tmp_path / "bundle"))


@pytest.fixture
def session(bundle: Path) -> Iterator[Session]:
    found = open_session(bundle, bundle, None, lambda text: None)
    yield found
    found.stop()


def settled(session: Session) -> dict[str, Any]:
    """Return the state once everything that was said is fitted."""
    state = session.state()
    while state["busy"]:
        state = session.state(after=state["number"], wait_s=60)
    return state


def yaw_of(session: Session, number: int) -> float:
    return session.scene["views"][number]["yaw"]


@pytest.mark.parametrize("name", ["calibration.json", CORRECTIONS])
def test_a_session_follows_no_link_out_of_its_bundle(name: str, bundle: Path) -> None:
    outside = bundle.parent / name
    shutil.copy(bundle / "calibration.json", outside)
    (bundle / name).unlink(missing_ok=True)
    (bundle / name).symlink_to(outside)
    with pytest.raises(BundleError, match=f"{name}: is a link out of the folder"):
        open_session(bundle, bundle, None, lambda text: None)


def test_the_page_shows_nothing_from_outside_of_its_bundle(bundle: Path) -> None:
    sheet = split_sheet(bundle.parent / "sheet.png")
    (bundle / "labels").mkdir()
    for name in ("mannequin.obj", "palette.json", "labels/000.png"):
        (bundle / name).unlink(missing_ok=True)
        (bundle / name).symlink_to(bundle.parent / "sheet.png")
        with pytest.raises(BundleError, match=f"{name}: is a link out of the folder"):
            scene_of(bundle, sheet)
        (bundle / name).unlink()


def test_a_correction_is_kept_at_once_and_fitted_soon(session: Session, bundle: Path) -> None:
    before = settled(session)
    assert len(before["scene"]["views"]) == 5
    assert before["scene"]["palette"]["colors"]
    for name in ("run", "test"):
        (bundle / name).mkdir()
        (bundle / name / "config.json").write_text("{}")
    box = session.scene["views"][1]["box"]
    said = {"version": 1, "views": [{"box": box, "exclude": True}]}
    assert session.save(said, 0) == 1
    assert json.loads((bundle / CORRECTIONS).read_bytes()) == said
    state = settled(session)
    assert state["error"] == ""
    assert len(state["scene"]["views"]) == 4
    assert len(read_bundle(bundle).scene.frames) == 4
    for name in ("run", "test"):  # a trained field stays, and what others put there
        assert (bundle / name / "config.json").read_text() == "{}"
    assert json.loads((bundle / CORRECTIONS).read_bytes()) == said
    assert sorted(place.name for place in bundle.parent.iterdir()) == [
        "bundle",
        "mannequin.obj",
        "sheet.png",
    ]
    page = (bundle / "edit.html").read_text(encoding="utf-8")
    assert "exclude" in page


def test_folders_of_others_are_there_again_after_a_kill_while_bundles_changed_places(
    bundle: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("run", "test"):
        (bundle / name).mkdir()
        (bundle / name / "config.json").write_text("{}")
    with monkeypatch.context() as killed:
        killed.setattr(refit, "clear_workshop", lambda subject: None)
        subject = Subject(bundle.parent / "sheet.png", Body.DEFAULT, bundle)
        new = Path(shutil.copytree(bundle, subject.workshop / "bundle"))
        shutil.rmtree(new / "run")
        shutil.rmtree(new / "test")
        refit.put_in_place(new, subject, {"version": 1})
    assert not (bundle / "run").exists()
    open_session(bundle, bundle, None, lambda text: None).stop()
    for name in ("run", "test"):
        assert (bundle / name / "config.json").read_text() == "{}"
    assert not subject.workshop.exists()


def test_the_command_line_makes_the_same_of_it(session, bundle, toonset):
    view = session.scene["views"][2]
    yaw = (view["yaw"] + 180) % 360
    said = {"version": 1, "views": [{"box": view["box"], "label": str(yaw), "lock": True}]}
    session.save(said, 0)
    assert settled(session)["error"] == ""
    off = abs((yaw_of(session, 2) - yaw + 180) % 360 - 180)
    assert off < 1
    other = bundle.parent / "other"
    arguments = ("--corrections", bundle / CORRECTIONS, "--mesh", bundle.parent / "mannequin.obj")
    done = toonset("calibrate", bundle.parent / "sheet.png", *arguments, "-o", other, "-q")
    assert done.code in (0, 3)
    for name in ("calibration.json", "transforms.json", "mannequin.obj"):
        assert (other / name).read_bytes() == (bundle / name).read_bytes(), name


def test_only_what_is_touched_is_found_again(session, bundle, toonset, monkeypatch):
    def refuse(*_: Any) -> Any:
        raise AssertionError("cameras were not touched")

    monkeypatch.setattr(session_module, "make_bundle", refuse)
    cameras = (bundle / "transforms.json").read_bytes()
    color = session.scene["palette"]["colors"][0]["color"]
    session.save({"version": 1, "palette": {"names": {color: "coat"}}}, 0)
    state = settled(session)
    assert state["error"] == ""
    assert state["scene"]["palette"]["colors"][0]["name"] == "coat"
    assert json.loads((bundle / PALETTE).read_bytes())["colors"][0]["name"] == "coat"
    assert (bundle / "transforms.json").read_bytes() == cameras
    session.stop()
    monkeypatch.setattr(opening, "make_bundle", refuse)  # it is known to be fitted
    again = open_session(bundle, bundle, None, lambda text: None)
    again.stop()
    assert again.fitted == again.corrections
    arguments = ("--corrections", bundle / CORRECTIONS, "--mesh", bundle.parent / "mannequin.obj")
    other = bundle.parent / "other"
    toonset("calibrate", bundle.parent / "sheet.png", *arguments, "-o", other, "-q")
    toonset("palette", other, "--corrections", bundle / CORRECTIONS, "-q")
    for name in ("calibration.json", "palette.json", "labels/000.png"):
        assert (other / name).read_bytes() == (bundle / name).read_bytes(), name


def test_what_cannot_be_fitted_is_said_and_undone(session: Session, bundle: Path) -> None:
    before = (bundle / "calibration.json").read_bytes()
    session.save({"version": 1, "boxes": [[0, 0, 9, 9]]}, 0)
    state = settled(session)
    assert "background only" in state["error"]
    assert (bundle / "calibration.json").read_bytes() == before
    session.save({"version": 1}, 1)
    assert settled(session)["error"] == ""
    assert bundle_problems(bundle) == []


def test_a_newer_correction_takes_the_place_of_one_that_waits(session, monkeypatch):
    began, go_on, fitted = threading.Event(), threading.Event(), []

    def slow(*arguments: Any) -> Any:
        fitted.append(arguments[1])
        began.set()
        assert go_on.wait(20)
        raise SheetError("not today")

    monkeypatch.setattr(session_module, "make_bundle", slow)
    said = [{"version": 1, "background": f"#00000{i}"} for i in range(4)]
    session.save(said[0], 0)
    assert began.wait(20)
    for revision, one in enumerate(said[1:], 1):
        session.save(one, revision)  # at once, while it fits
    go_on.set()
    settled(session)
    assert fitted == [said[0], said[3]]


def test_a_tab_that_is_behind_is_told(session: Session, bundle: Path) -> None:
    session.save({"version": 1, "background": "#ffffff"}, 0)
    with pytest.raises(StaleError):
        session.save({"version": 1}, 0)
    with pytest.raises(SheetError):
        session.save({"version": 1, "boxen": []}, 1)
    assert json.loads((bundle / CORRECTIONS).read_bytes())["background"] == "#ffffff"


def test_what_was_written_by_hand_meanwhile_is_not_written_over(session, bundle):
    session.save({"version": 1, "background": "#ffffff"}, 0)
    settled(session)
    by_hand = b'{"version": 1, "background": "#fffffe"}'
    (bundle / CORRECTIONS).write_bytes(by_hand)
    with pytest.raises(SheetError, match="was changed by another program; stop `toonset edit`"):
        session.save({"version": 1}, 1)
    assert (bundle / CORRECTIONS).read_bytes() == by_hand


def test_parts_that_change() -> None:
    view = {"box": [1, 2, 3, 4]}
    nothing: dict[str, Any] = {"version": 1}
    assert parts_changed(nothing, {"version": 1, "sheet": {}}) == Changed(False, False, False)
    said = nothing | {"views": [view | {"label": "front"}]}
    assert parts_changed(nothing, said) == Changed(False, True, False)
    assert parts_changed(nothing, {"views": [view | {"exclude": True}]}) == Changed(
        True, True, True
    )
    assert parts_changed(said, said | {"palette": {"drop": []}}) == Changed(False, False, True)
    assert parts_changed(said, said | {"outfit": "B"}) == Changed(True, True, True)


def test_an_outfit_is_cut_as_corrections_say(tmp_path: Path) -> None:
    sheet = tmp_path / "outfits.png"
    sheet.write_bytes(encode_png(make_messy_sheet(4102, ("outfits",)).rgba))
    whole = split_sheet(sheet)
    row = whole.split.sources[0].groups[0].rows[1]
    said = {"version": 1, "outfit": "B", "views": [{"box": list(row[0]), "label": "front"}]}
    found, file = refit.cut_sheet(sheet, said, tmp_path)
    assert len(found.views) == len(row) < len(whole.views)
    assert [view.label for view in found.views] == ["front", *[""] * (len(row) - 1)]
    assert file is not None
    assert json.loads(file.read_bytes()) == said


def test_a_bundle_of_another_outfit_is_opened_as_it_was_cut(tmp_path: Path) -> None:
    sheet = tmp_path / "outfits.png"
    sheet.write_bytes(encode_png(make_messy_sheet(4102, ("outfits",)).rgba))
    options = {"outfit": "B"}
    views = split_sheet(sheet, SheetOptions(outfit="B")).views
    found = cast(CalibrationFile, SimpleNamespace(options=options, views=views))
    _, corrections = opening._as_it_was_cut(Subject(sheet, Body.DEFAULT, tmp_path), found)
    assert corrections == {"version": 1, "outfit": "B"}


def test_reasons_on_the_page_name_no_options() -> None:
    reason = f"the front is open; {ASK}"
    assert "(--front 0)" in reason
    assert for_page(reason) == "the front is open; say which view is the front"


def test_what_is_no_bundle_is_refused(bundle: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(BundleError, match="is no bundle"):
        folder_of(tmp_path / "empty", tmp_path / "out")
    with pytest.raises(ToonsetError, match="no such file"):
        folder_of(tmp_path / "nothing", tmp_path / "out")
    (tmp_path / "sheet.png").rename(tmp_path / "moved.png")
    with pytest.raises(BundleError, match=r"made of sheet\.png, which is not beside it"):
        open_session(bundle, bundle, None, lambda text: None)
    other = tmp_path / "other.png"
    other.write_bytes(b"other")
    with pytest.raises(BundleError, match=r"made of another sheet, sheet\.png"):
        open_session(other, bundle, None, lambda text: None)


def test_corrections_that_calibrate_was_given_are_taken_over(bundle, toonset):
    box = [0, 0, 120, 120]
    said = {"version": 1, "views": [{"box": box, "exclude": True}]}
    (bundle.parent / "mine.json").write_text(json.dumps(said))
    other = bundle.parent / "other"
    arguments = ("--corrections", bundle.parent / "mine.json", "-q", "-o", other)
    toonset("calibrate", bundle.parent / "sheet.png", *arguments)
    session = open_session(other, other, None, lambda text: None)
    session.stop()
    assert session.corrections == session.fitted == said
    (bundle.parent / "mine.json").unlink()
    with pytest.raises(BundleError, match=r"made with mine\.json, which is not beside it"):
        open_session(other, other, None, lambda text: None)


class Editing:
    """`toonset edit` as a process, and what asks its server."""

    def __init__(self, bundle: Path) -> None:
        command = [sys.executable, "-m", "toonset", "edit", bundle.name, "--no-browser", "--json"]
        self.process = subprocess.Popen(
            command, cwd=bundle.parent, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line, self.process.communicate()
        self.origin, _, key = json.loads(line)["url"].partition("/#")
        self.token = ""
        self.token = self.ask("/api/open", {"key": key})["token"]

    def ask(self, path: str, body: Any = None) -> Any:
        connection = HTTPConnection(self.origin.removeprefix("http://"), timeout=60)
        headers = {"X-Toonset-Token": self.token}
        if body is None:
            connection.request("GET", path, headers=headers)
        else:
            headers |= {"Content-Type": "application/json", "Origin": self.origin}
            connection.request("POST", path, json.dumps(body), headers)
        answer = connection.getresponse()
        assert answer.status == 200, answer.read()
        return json.loads(answer.read())

    def settled(self) -> Any:
        state = self.ask("/api/state?after=-1&scene=-1")
        while state["busy"]:
            state |= self.ask(f"/api/state?after={state['number']}&scene=-1")
        return state

    def end(self, sign: signal.Signals) -> int:
        self.process.send_signal(sign)
        self.process.communicate(timeout=60)
        return self.process.returncode


def test_a_kill_loses_nothing_that_was_answered(bundle: Path, shell: Command) -> None:
    (bundle / f".{CORRECTIONS}.ab12cd34.tmp").write_bytes(b"{")  # an earlier one, as it wrote
    editing = Editing(bundle)
    refused = shell("edit", bundle, "--no-browser")
    assert "is in use by another toonset" in refused.reason
    refused = shell("calibrate", bundle.parent / "sheet.png", "-o", bundle, "--force")
    assert "is in use by another toonset" in refused.reason
    box = editing.settled()["scene"]["views"][0]["box"]
    assert not list(bundle.glob(".*"))
    said = {"version": 1, "views": [{"box": box, "exclude": True}]}
    editing.ask("/api/corrections", {"revision": 0, "corrections": said})
    assert editing.end(signal.SIGKILL) == -signal.SIGKILL  # while it fits
    assert json.loads((bundle / CORRECTIONS).read_bytes()) == said
    assert bundle_problems(bundle) == []  # the older one, whole
    again = Editing(bundle)
    state = again.settled()
    assert state["corrections"] == said
    assert len(state["scene"]["views"]) == 4
    assert again.end(signal.SIGINT) == 0
    left = {".bundle.edit", ".bundle.lock"} & {one.name for one in bundle.parent.iterdir()}
    assert not left


@pytest.mark.slow
@pytest.mark.parametrize("sign", [signal.SIGTERM, signal.SIGHUP])
def test_it_ends_with_its_terminal(bundle: Path, sign: signal.Signals) -> None:
    assert Editing(bundle).end(sign) == 0
