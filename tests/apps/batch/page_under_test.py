"""A made-up batch, and its page in a browser that lets nothing pass unseen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from playwright.sync_api import Page

from lab.bench.batch.rows import FIRST_FIRST, sheet
from toonset.apps.batch.rows import SheetRow


def one_of_each() -> list[SheetRow]:
    """Return a sheet of each kind, in the order in which nobody wants to see them."""
    kinds = list(reversed(FIRST_FIRST))
    return [
        sheet(f"{state}-{verdict or 'none'}", state, verdict, position=i, seconds=10.0 * (i + 1))
        for i, (state, verdict) in enumerate(kinds)
    ]


@dataclass
class Shown:
    """An open page, what it said on the console and what it asked of others."""

    page: Page
    noise: list[str] = field(default_factory=list)

    @property
    def names(self) -> list[str]:
        return self.page.locator("#rows .sheet-name").all_inner_texts()

    @property
    def line(self) -> str:
        return self.page.locator("#count").inner_text()

    @property
    def hash(self) -> str:
        self.page.wait_for_timeout(300)  # the address is written after the last change
        return str(self.page.evaluate("location.hash"))

    def row(self, name: str) -> str:
        return self.page.locator(
            "#rows tr", has=self.page.get_by_text(name, exact=True)
        ).inner_text()

    def press(self, group: str, word: str) -> None:
        self.page.get_by_role("group", name=group).get_by_role("checkbox", name=word).click()

    def sort(self, column: str) -> None:
        self.page.get_by_role("columnheader", name=column).get_by_role("button").click()


def names_of(rows: Sequence[SheetRow]) -> list[str]:
    return [row.name for row in rows]
