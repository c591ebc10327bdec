"""The page that its server has opened: kept at once, fitted without a reload, two tabs."""

import json
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from tests.apps.web.editor.conftest import Open
from tests.apps.web.editor.page_under_test import Editor
from toonset.apps.web.editor.opening import open_session
from toonset.apps.web.editor.refit import CORRECTIONS
from toonset.apps.web.editor.server import Server
from toonset.apps.web.editor.session import Session


@dataclass
class Desk:
    """A bundle that is being edited."""

    folder: Path
    server: Server
    session: Session
    open_at: Open
    opened: list[Editor] = field(default_factory=list)

    def open(self) -> Editor:
        self.opened.append(self.open_at(self.server.address, self.server.origin + "/"))
        return self.opened[-1]

    @property
    def kept(self) -> dict[str, Any]:
        return json.loads((self.folder / CORRECTIONS).read_bytes())


@pytest.fixture
def desk(
    drawn: Path, calibrated: tuple[Path, Any], tmp_path: Path, open_at: Open
) -> Iterator[Desk]:
    for name in ("sheet.png", "mannequin.obj"):
        shutil.copy(drawn / name, tmp_path / name)
    folder = Path(shutil.copytree(calibrated[0], tmp_path / "bundle"))
    session = open_session(folder, folder, None, lambda text: None)
    with Server("bundle") as server:
        thread = server.serve(session)
        desk = Desk(folder, server, session, open_at)
        yield desk
        for editor in desk.opened:  # an open page would ask a server that stops, and complain
            editor.page.context.close()
        server.shutdown()
        session.stop()
        thread.join()


def fitted(editor: Editor, text: str = "Kept and fitted.") -> None:
    editor.page.get_by_text(text, exact=False).wait_for(timeout=60_000)


def test_a_correction_is_fitted_without_a_reload(desk: Desk) -> None:
    editor = desk.open()
    assert editor.page.evaluate("location.hash") == ""  # the key is good for once
    count = "toonset.model.scene.views.length"
    assert editor.page.evaluate(count) == 5
    editor.card("Leave out", 1)
    editor.until(f"{count} === 4")
    assert desk.kept["views"][0]["exclude"]
    assert "It is left out." in editor.page.locator(".card").last.inner_text()
    editor.page.reload()  # the tab goes on where it was
    editor.page.wait_for_selector("#work:not([hidden])")
    assert len(editor.views) == 1
    editor.click("Undo")
    editor.until(f"{count} === 5")
    assert "views" not in desk.kept


def test_two_tabs_show_the_same(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(desk.session, "_fit", lambda changed: None)
    one, other = desk.open(), desk.open()
    one.card("Lock", 1)
    other.until("toonset.model.said.views?.length === 1")
    assert "Another tab has changed this" in other.page.locator("#message").inner_text()
    other.card("Lock", 2)
    one.until("toonset.model.said.views?.length === 2")
    assert len(desk.kept["views"]) == 2


def test_a_tab_that_is_behind_shows_what_is_there(desk, monkeypatch):
    monkeypatch.setattr(desk.session, "_fit", lambda changed: None)
    editor = desk.open()
    with desk.session._news:  # it hears nothing of it yet
        desk.session.revision += 1
        desk.session.corrections = {"version": 1, "background": "#ffffff"}
    editor.card("Lock", 1)
    editor.until("toonset.model.said.background === '#ffffff'")
    assert "Another tab was faster" in editor.page.locator("#message").inner_text()
    assert editor.noise.pop().startswith("Failed to load resource")  # what a browser says of a 409
    assert "views" not in editor.said


def test_an_error_is_shown_and_undone(desk: Desk) -> None:
    editor = desk.open()
    editor.mode("Figures")
    editor.page.evaluate("toonset.model.change({ version: 1, boxes: [[0, 0, 9, 9]] })")
    fitted(editor, "background only")
    editor.click("Undo")
    fitted(editor, "Nothing is corrected yet.")


def test_an_address_that_was_used_is_refused(desk, barriers):
    used = desk.server.address
    desk.open()
    late = desk.open_at(used, desk.server.origin + "/")
    assert "This address was used already" in late.page.locator("#trouble").inner_text()
    assert barriers(late.page) == []
    assert late.page.locator("#work").is_hidden()
    assert all("401" in noise for noise in late.noise)
    late.noise.clear()


def test_a_server_that_stops_is_told(desk: Desk) -> None:
    editor = desk.open()
    desk.server.shutdown()
    desk.session.stop()
    desk.server.server_close()
    state = editor.page.locator("#state")
    state.get_by_text("The server has stopped").wait_for()
    editor.card("Lock", 1)
    state.get_by_text("Not kept: the server has stopped").wait_for()
    assert editor.download()["views"][0]["lock"]
    editor.noise.clear()
