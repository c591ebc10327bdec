"""What tests of the correcting page share: pages that must stay quiet."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Request

from tests.apps.web.editor.page_under_test import Editor, figure_scene
from toonset.apps.web.editor.scene import page_of

Open = Callable[..., Editor]


@pytest.fixture
def open_at(browser: Browser) -> Iterator[Open]:
    """Return a function that opens an address; nothing on the console, no request elsewhere."""
    opened: list[Editor] = []

    def open_one(address: str, own: str, **options: Any) -> Editor:
        context = browser.new_context(**{"viewport": {"width": 1200, "height": 900}, **options})
        editor = Editor(context.new_page())
        editor.page.set_default_timeout(20_000)
        opened.append(editor)
        editor.page.on("console", lambda message: editor.noise.append(message.text))
        editor.page.on("pageerror", lambda error: editor.noise.append(str(error)))

        def note(request: Request) -> None:
            if not request.url.startswith(("data:", "blob:", own)):
                editor.noise.append(request.url)

        editor.page.on("request", note)
        editor.page.goto(address)
        editor.page.wait_for_selector("#work:not([hidden]), #trouble:not([hidden])")
        return editor

    yield open_one
    for editor in opened:
        editor.page.context.close()
        assert editor.noise == []


@pytest.fixture
def open_page(open_at: Open, tmp_path: Path) -> Open:
    """Return a function that opens the page of a made-up bundle as a file."""

    def open_one(
        corrections: dict[str, Any] | None = None,
        *,
        body: bool = True,
        title: str = "A bundle",
        outfits: bool = False,
        **options: Any,
    ) -> Editor:
        path = tmp_path / "edit.html"
        page = page_of(
            figure_scene(body, title, outfits=outfits), corrections or {"version": 1}, title
        )
        path.write_text(page, encoding="utf-8")
        return open_at(path.as_uri(), path.as_uri(), **options)

    return open_one


@pytest.fixture
def editor(open_page: Open) -> Editor:
    """Return the page of a made-up bundle with a mannequin."""
    return open_page()
