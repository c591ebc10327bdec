"""What tests of the page share: pages that must stay quiet."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Request

from tests.apps.web.viewer.page_under_test import Viewer, write_page

Open = Callable[..., Viewer]


@pytest.fixture
def open_page(browser: Browser, tmp_path: Path) -> Iterator[Open]:
    """Return a function that opens a page; nothing on the console, no request is let pass."""
    opened: list[Viewer] = []

    def open_one(hash: str = "", scene: dict[str, Any] | None = None, **options: Any) -> Viewer:
        path = write_page(tmp_path, **(scene or {}))
        context = browser.new_context(
            **{"viewport": {"width": 1000, "height": 800}, "reduced_motion": "reduce", **options}
        )
        viewer = Viewer(context.new_page())
        viewer.page.set_default_timeout(20_000)
        opened.append(viewer)
        viewer.page.on("console", lambda message: viewer.noise.append(message.text))
        viewer.page.on("pageerror", lambda error: viewer.noise.append(str(error)))

        def note(request: Request) -> None:
            if not request.url.startswith(("data:", "blob:", path.as_uri())):
                viewer.noise.append(request.url)

        viewer.page.on("request", note)
        viewer.page.goto(path.as_uri() + hash)
        started = "#poster[hidden], #fallback:not([hidden])"
        viewer.page.wait_for_selector(started, state="attached")
        return viewer

    yield open_one
    for viewer in opened:
        viewer.page.context.close()
        assert viewer.noise == []
