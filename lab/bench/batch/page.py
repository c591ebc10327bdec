"""How soon the page of a large batch is there, and how soon it answers, in Chromium."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

from playwright.sync_api import Browser, Page

from lab.bench.batch.rows import draw_thumbs, many
from lab.bench.view.compare import chromium
from toonset.apps.batch.page import PAGE, write_page

PICTURES = 2000  # sheets that have small pictures
OPENED = 5
FOUND = ("k", "kn", "knight", "sheet77", "nobody", "")
SORTED = ("name", "seconds", "memory", "views", "state")
PAINT = "performance.getEntriesByName('first-contentful-paint')[0].startTime"
ASK = """async ([kind, value]) => {
  const frame = () => new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
  await frame();
  const began = performance.now();
  if (kind === "find") {
    const field = document.getElementById("find");
    field.value = value;
    field.dispatchEvent(new Event("input"));
  } else if (kind === "filter") document.querySelector(`#states input[value=${value}]`).click();
  else document.querySelector(`th[data-column=${value}] button`).click();
  await frame();
  return performance.now() - began;
}"""


def report(work: Path, rows: int, say: Callable[[str], None]) -> None:
    """Print the milliseconds until a page is shown, and until an answer is.

    Args:
        work: folder for the page.
        rows: sheets on it.
        say: prints a line.
    """
    draw_thumbs(work, (f"sheet{number}" for number in range(PICTURES)))
    began = time.perf_counter()
    write_page(work, many(rows), "many")
    spent, size = time.perf_counter() - began, (work / PAGE).stat().st_size
    say(f"page of {rows:,} sheets: {size / rows:.0f} bytes a sheet, written in {spent:.2f} s")
    with chromium() as browser:
        paints = [_opened(browser, work).evaluate(PAINT) for _ in range(OPENED)]
        say(f"  first paint: median {median(paints):.0f} ms, longest {max(paints):.0f} ms")
        page = _opened(browser, work)
        for kind, values in (("find", FOUND), ("filter", ("done", "done")), ("sort", SORTED)):
            taken = [page.evaluate(ASK, [kind, value]) for value in values]
            say(f"  {kind}: median {median(taken):.0f} ms, longest {max(taken):.0f} ms")


def _opened(browser: Browser, work: Path) -> Page:
    page = browser.new_context(viewport={"width": 1280, "height": 900}).new_page()
    page.goto((work / PAGE).as_uri())
    page.wait_for_selector("#written:not(:empty)")
    page.wait_for_timeout(300)
    return page
