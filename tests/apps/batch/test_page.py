"""The page of a batch, written and read as people do."""

from __future__ import annotations

import functools
import http.server
import json
import math
import re
import threading
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Request, expect

from lab.bench.batch.rows import FIRST_FIRST, draw_thumbs, many, sheet
from tests.apps.batch.page_under_test import Shown, names_of, one_of_each
from toonset.apps.batch import page as page_module
from toonset.apps.batch.page import write_page
from toonset.apps.batch.rows import SheetRow
from toonset.apps.batch.stages import RANKS

Open = Callable[..., Shown]
HOSTILE = (
    "<img src=x onerror=alert(1)>",
    "</script><script>alert(1)</script>",
    "<!--<script>",
    "\"'`&amp;\\u003c",
    "\u2028\u2029",
    "\u202e\u05d0\u05d1 reversed",
    "<rows>{{rows}}{{script}}",
)


@pytest.fixture
def open_page(browser: Browser, tmp_path: Path) -> Iterator[Open]:
    """Return a function that opens a page; it stays quiet and asks for its pictures only."""
    opened: list[Shown] = []

    def open_one(
        rows: Iterable[SheetRow], hash: str = "", *, title: str = "batch", **options: Any
    ) -> Shown:
        store = options.pop("store", "")
        base = options.pop("base", tmp_path.as_uri())
        write_page(tmp_path, rows, title, store=store)
        context = browser.new_context(**{"viewport": {"width": 1280, "height": 900}, **options})
        shown = Shown(context.new_page())
        shown.page.set_default_timeout(20_000)
        opened.append(shown)
        shown.page.on("console", lambda message: shown.noise.append(message.text))
        shown.page.on("pageerror", lambda error: shown.noise.append(str(error)))
        shown.page.on("dialog", lambda dialog: shown.noise.append(dialog.message))

        def note(request: Request) -> None:
            own = (f"{base}/index.html", f"{base}/thumbs/", "data:")
            if not request.url.startswith(own):
                shown.noise.append(request.url)

        shown.page.on("request", note)
        shown.page.goto(f"{base}/index.html{hash}")
        shown.page.wait_for_selector("#written:not(:empty)")
        return shown

    yield open_one
    for shown in opened:
        shown.page.context.close()
        assert shown.noise == []


# ---- the file ------------------------------------------------------------------------------------


def page_values(out: Path) -> list[list[Any]]:
    """Return the rows in a page's file."""
    text = (out / "index.html").read_text(encoding="utf-8")
    blocks = re.findall(r'<script class="rows" type="application/json">(.*?)</script>', text)
    return [values for block in blocks for values in json.loads(block)]


def test_a_reader_sees_the_old_page_or_all_of_the_new_one(tmp_path: Path) -> None:
    write_page(tmp_path, one_of_each(), "old")
    old = (tmp_path / "index.html").read_bytes()

    def watched() -> Iterator[SheetRow]:
        for row in many(1200):
            assert (tmp_path / "index.html").read_bytes() == old
            yield row

    write_page(tmp_path, watched(), "new")
    assert [values[0] for values in page_values(tmp_path)] == names_of(list(many(1200)))
    assert [path.name for path in tmp_path.iterdir()] == ["index.html"]


def test_what_fails_leaves_the_old_page(tmp_path: Path) -> None:
    write_page(tmp_path, one_of_each(), "old")
    old = (tmp_path / "index.html").read_bytes()

    def broken() -> Iterator[SheetRow]:
        yield from many(700)
        raise ValueError

    with pytest.raises(ValueError, match=r"^$"):
        write_page(tmp_path, broken(), "new")
    assert (tmp_path / "index.html").read_bytes() == old
    assert [path.name for path in tmp_path.iterdir()] == ["index.html"]


def test_rows_are_written_a_block_at_a_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes = []

    def counted(values: Any) -> str:
        sizes.append(len(values))
        return json.dumps(values)

    monkeypatch.setattr(page_module, "json_text", counted)
    write_page(tmp_path, many(1201), "batch")
    assert sizes[1:] == [500, 500, 201]


def test_numbers_that_are_none_and_words_that_are_too_long(tmp_path: Path) -> None:
    row = sheet("a", reason="x" * 10_000, seconds=math.nan, memory=math.inf)
    odd = sheet("b", character="lone \ud800")
    write_page(tmp_path, [row, odd], "t\udc80")
    first, second = page_values(tmp_path)
    assert len(first[4]) < 1000
    assert 0 in first
    assert second[1] == "lone ?"


# ---- what is shown -------------------------------------------------------------------------------


def test_what_went_wrong_comes_first(open_page: Open) -> None:
    shown = open_page(one_of_each())
    assert shown.names == [f"{state}-{verdict or 'none'}" for state, verdict in FIRST_FIRST]
    assert "failed in palette" in shown.row("failed-none")
    assert "found no figures" in shown.row("failed-none")
    assert "cameras ambiguous" in shown.row("done-ambiguous")
    assert "drawing 2 may show the back" in shown.row("done-ambiguous")
    assert "7 colours, 31.2 dB" in shown.row("done-ok")
    numbers = shown.page.locator("#rows tr").first.locator(".number").all_inner_texts()
    assert numbers == ["8", "40", "800", "3"]
    assert shown.line == "8 sheets"
    assert "2 to come" in shown.page.locator("#written").inner_text()


def test_a_click_on_a_count_filters(open_page: Open) -> None:
    shown = open_page(one_of_each())
    shown.press("Sheets", "done")
    assert len(shown.names) == 4
    shown.press("Cameras", "weak")
    shown.press("Cameras", "ok")
    assert shown.names == ["done-weak", "done-ok"]
    assert shown.line == "2 sheets, of 8 in all"
    assert shown.hash == "#state=done&cameras=weak,ok"
    shown.press("Sheets", "done")
    shown.press("Sheets", "running")
    assert shown.names == []
    assert shown.page.locator("#none").inner_text() == "No sheet is like that."
    shown.page.get_by_role("button", name="Show all").click()
    assert len(shown.names) == 8
    assert shown.hash == ""


def test_words_are_found_in_names_characters_and_errors(open_page: Open) -> None:
    rows = [
        sheet("Anna1", character="Queen"),
        sheet("b", "failed", "", error="Über the queen's head"),
        sheet("c", character="Knight"),
    ]
    shown = open_page(rows)
    find = shown.page.get_by_label("Find")
    for words, names in (
        ("anna", ["Anna1"]),
        ("QUEEN", ["b", "Anna1"]),
        ("head über", ["b"]),
        ("knight queen", []),
        (" ", ["b", "Anna1", "c"]),
    ):
        find.fill(words)
        assert shown.names == names


def test_columns_sort_both_ways(open_page: Open) -> None:
    rows = [
        sheet("a10", seconds=3, memory=700, views=9),
        sheet("a2", seconds=0, memory=900, views=3, position=1),
        sheet("A1", seconds=5, memory=800, views=3, position=2),
    ]
    shown = open_page(rows)
    header = shown.page.locator("th[aria-sort]")
    for column, names in (
        ("Name", ["A1", "a2", "a10"]),
        ("Views", ["a10", "a2", "A1"]),
        ("Seconds", ["A1", "a10", "a2"]),
        ("Memory", ["a2", "A1", "a10"]),
        ("Memory", ["a10", "A1", "a2"]),
    ):
        shown.sort(column)
        assert shown.names == names, column
    assert header.get_attribute("aria-sort") == "ascending"
    shown.sort("Seconds")
    shown.sort("Seconds")
    assert shown.names == ["a10", "A1", "a2"]  # what has none stays last
    shown.sort("State")
    assert shown.names == ["a10", "a2", "A1"]
    assert header.get_attribute("aria-sort") == "ascending"


def test_a_link_holds_it_all(open_page: Open) -> None:
    words = "#find=knight&state=done&cameras=weak,ok&sort=seconds&back=1&page=2"
    shown = open_page(many(800), words)
    assert shown.page.get_by_label("Find").input_value() == "knight"
    assert shown.page.get_by_role("checkbox", name="weak").is_checked()
    assert shown.line.startswith("51 to 100 of ")
    assert shown.hash == words
    first = shown.names
    shown.page.reload()
    assert shown.names == first
    shown.page.evaluate("location.hash = '#sort=name'")
    shown.page.wait_for_selector("th[data-column=name][aria-sort]")
    assert shown.names[:3] == ["sheet0", "sheet1", "sheet2"]


def test_garbled_links_are_passed_over(open_page: Open) -> None:
    shown = open_page(one_of_each())
    for words in ("#page=-1&sort=x&state=,,&cameras=<b>", "#%%%", "#page=999999", "#find=%ff"):
        shown.page.evaluate(
            "words => { location.hash = '#find=none'; location.hash = words; }", words
        )
        shown.page.wait_for_timeout(50)
        assert len(shown.names) == (0 if "find" in words else 8), words


def test_pages_of_rows(open_page: Open) -> None:
    shown = open_page(many(120), "#sort=name")
    page = shown.page
    assert shown.names == [f"sheet{i}" for i in range(50)]
    assert page.get_by_role("button", name="Previous").is_disabled()
    page.get_by_role("button", name="Next").click()
    assert shown.names == [f"sheet{i}" for i in range(50, 100)]
    assert shown.line == "51 to 100 of 120 sheets"
    assert page.evaluate("document.activeElement.id") == "count"
    number = page.get_by_role("spinbutton", name="Page")
    number.fill("7")
    number.press("Enter")
    assert shown.names == [f"sheet{i}" for i in range(100, 120)]
    assert page.get_by_role("button", name="Next").is_disabled()
    page.get_by_label("Find").fill("sheet11")
    assert shown.names == ["sheet11", *(f"sheet{i}" for i in range(110, 120))]
    assert page.locator("#pages").is_hidden()


NAME_OF_FOCUS = """() => {
  const one = document.activeElement;
  return one.getAttribute("aria-label") || one.value || one.textContent;
}"""


def test_keys_reach_and_work_everything(open_page: Open) -> None:
    shown = open_page(one_of_each())
    keys, reached = shown.page.keyboard, []
    for _ in range(30):
        keys.press("Tab")
        reached.append(shown.page.evaluate(NAME_OF_FOCUS))
    for wanted in ("quarantined", "Copy link", "Name", "log of failed-none"):
        assert wanted in reached
    shown.page.get_by_role("checkbox", name="quarantined").focus()
    keys.press("Space")
    assert shown.names == ["quarantined-none"]
    shown.page.get_by_role("columnheader", name="Name").get_by_role("button").focus()
    keys.press("Enter")
    assert shown.hash == "#state=quarantined&sort=name"


# ---- links and pictures --------------------------------------------------------------------------


def links(shown: Shown) -> dict[str, str]:
    found = shown.page.locator("#rows .links a")
    return {one.inner_text(): str(one.get_attribute("href")) for one in found.all()}


def test_links_lead_to_what_is_done(open_page: Open) -> None:
    shown = open_page([sheet("a%b #?ü", "failed", "ok")])
    name = "a%25b%20%23%3F%C3%BC"
    assert links(shown) == {
        "overlay": f"sheets/{name}/bundle/overlay.png",
        "cameras": f"sheets/{name}/bundle/transforms.json",
        "log": f"sheets/{name}/log.txt",
    }


def test_a_turntable_without_a_gif_has_no_link(tmp_path: Path) -> None:
    row = sheet("a", words={"render": ("--no-gif",)})
    write_page(tmp_path, [row, sheet("b")], "batch")
    (without, done), turned = [values[11] for values in page_values(tmp_path)], 1 << RANKS["render"]
    assert (without & turned, without | turned) == (0, done)
    gif = tmp_path / "sheets/a/turntable/turntable.gif"
    gif.parent.mkdir(parents=True)
    gif.touch()
    write_page(tmp_path, [row], "batch")
    assert page_values(tmp_path)[0][11] == done


def test_results_elsewhere(open_page: Open, tmp_path: Path) -> None:
    write_page(tmp_path, [sheet("a")], "batch", store="https://store.example/batch/")
    assert '"results":"https://store.example/batch/"' in (tmp_path / "index.html").read_text()
    rows = [sheet("a"), sheet("b", "failed", "ok")]
    assert links(open_page(rows, store="s3://bucket/batch")) == {"log": "sheets/b/log.txt"}


def test_pictures_are_shown_and_turn_when_they_are_looked_at(
    open_page: Open, tmp_path: Path
) -> None:
    draw_thumbs(tmp_path, ["a", "b"])
    rows = [sheet("a"), sheet("b", position=1), sheet("c", position=2)]
    shown = open_page(rows)
    page = shown.page
    page.wait_for_selector("#rows tr:nth-child(2) canvas")
    overlays = page.locator(".picture:not(.turn) img")
    assert [one.evaluate("img => img.naturalWidth") for one in overlays.all()] == [48, 48]
    assert page.locator("img:not([loading=lazy])").count() == 0
    moving = page.locator(".turn img")
    assert moving.count() == 0
    page.locator("#rows tr").first.hover()
    assert moving.count() == 1
    page.mouse.move(5, 5)
    assert moving.count() == 0
    page.get_by_role("link", name="overlay of b").focus()
    assert page.locator("tr:nth-child(2) .turn img").count() == 1
    turn = page.get_by_role("button", name="Turn all")
    turn.click()
    assert moving.count() == 2
    turn.click()
    expect(moving).to_have_count(0)
    assert page.locator("tr:nth-child(3) .picture").count() == 0


def test_only_pictures_near_the_window_are_loaded(open_page: Open, tmp_path: Path) -> None:
    rows = list(many(50))
    draw_thumbs(tmp_path, names_of(rows))
    shown = open_page(rows, viewport={"width": 1280, "height": 400})
    shown.page.wait_for_selector(".turn canvas")
    loaded = "[...document.images].filter((one) => one.complete).length"
    assert 0 < shown.page.evaluate(loaded) < 80
    shown.page.evaluate("scrollTo(0, document.body.scrollHeight)")
    shown.page.wait_for_selector("tr:last-child .turn canvas")


def test_it_works_from_a_server(open_page: Open, tmp_path: Path) -> None:
    draw_thumbs(tmp_path, ["a"])

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, format: str, *args: Any) -> None:
            pass

    handler = functools.partial(Quiet, directory=tmp_path)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        shown = open_page([sheet("a")], base=f"http://127.0.0.1:{server.server_port}")
        shown.page.wait_for_selector(".turn canvas")
        shown.page.context.close()
        server.shutdown()


# ---- what may go wrong ---------------------------------------------------------------------------


@pytest.mark.parametrize("rtl", [False, True])
def test_words_that_mean_harm_stay_words(open_page: Open, rtl: bool) -> None:
    rows = [
        sheet(f"s{i}", "failed", "", error=words, character=words, position=i)
        for i, words in enumerate(HOSTILE)
    ] + [sheet("n/" + HOSTILE[0], "done", "weak", reason=HOSTILE[1], position=99)]
    size = {"width": 360, "height": 740}
    shown = open_page(rows, title=HOSTILE[1] + HOSTILE[-1], viewport=size)
    page = shown.page
    if rtl:
        page.evaluate("document.documentElement.dir = 'rtl'")
    said = "(selector) => [...document.querySelectorAll(selector)].map((one) => one.textContent)"
    assert page.evaluate(said, ".error") == list(HOSTILE)
    assert page.evaluate(said, ".character") == list(HOSTILE)
    assert page.evaluate(said, ".reason") == [HOSTILE[1]]
    assert shown.names[-1] == "n/" + HOSTILE[0]
    assert page.title() == HOSTILE[1] + HOSTILE[-1]
    assert page.locator("#title").inner_text() == HOSTILE[1] + HOSTILE[-1]
    assert page.locator("#rows img").count() == 0
    page.get_by_label("Find").fill("<img")
    assert shown.names == ["s0", "n/" + HOSTILE[0]]
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    assert "alert" not in shown.hash


@pytest.mark.parametrize(
    ("rows", "line", "hidden"),
    [
        ([], "", ["#summary", "#sheets", "#pages"]),
        (
            [sheet("a", "waiting", ""), sheet("b", "running", "")],
            "2 sheets",
            ["#verdicts", "#none"],
        ),
        ([sheet(f"s{i}", "failed", "") for i in range(60)], "1 to 50 of 60 sheets", ["#none"]),
    ],
    ids=["empty", "begun", "all failed"],
)
def test_batches_of_one_kind(
    open_page: Open, rows: list[SheetRow], line: str, hidden: list[str]
) -> None:
    shown = open_page(rows)
    assert shown.line == line
    assert all(shown.page.locator(one).is_hidden() for one in hidden)
    assert shown.page.locator("#none").is_visible() == (not rows)


@pytest.mark.parametrize(
    ("width", "scheme", "count"), [(360, "light", 0), (800, "dark", 0), (1280, "dark", 51)]
)
def test_nothing_bars_the_way(open_page, barriers, tmp_path, width, scheme, count):
    draw_thumbs(tmp_path, ["done-ok", "done-weak", "sheet20"])
    size = {"width": width, "height": 740}
    rows = [*one_of_each(), *many(count)]
    shown = open_page(rows, viewport=size, color_scheme=scheme)
    page = shown.page
    assert page.evaluate("document.documentElement.scrollWidth") == width
    small = """() => [...document.querySelectorAll("button, input:not([type=checkbox]), .links a")]
      .filter((one) => one.offsetParent).map((one) => one.getBoundingClientRect())
      .filter((box) => Math.min(box.width, box.height) < 20).length"""
    assert page.evaluate(small) == 0
    if not count:
        for state in ("done", "running", "failed"):
            shown.press("Sheets", state)
        shown.sort("Seconds")
    assert barriers(page) == []
