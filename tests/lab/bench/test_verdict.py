"""The bench of the verdict: what it is measured on, and that counts are right."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import lab.bench.verdict.__main__ as command
from lab.bench.verdict.curve import BAD, FINE, draw_curve, rank_correlation, table
from lab.bench.verdict.fit import OWN, character_of, told, told_text
from lab.bench.verdict.measure import TERMS, Judged, by_pixel, terms_of
from toonset.nerf.score.between import BetweenView
from toonset.nerf.score.verdict import MOST_OFF, OK, WEAK


def judged(name: str, verdict: str, off: float, look: float) -> Judged:
    return Judged(name, verdict, (), off, (look / 2, look))


def test_missed_and_false_alarms_are_counted_beside_what_is_neither() -> None:
    found = [
        judged("good", OK, 0.01, 0.5 * FINE),
        judged("alarm", WEAK, 0.03, 0.9 * FINE),
        judged("between", WEAK, 0.03, (FINE + BAD) / 2),
        judged("bad", WEAK, 0.03, 1.1 * BAD),
        judged("missed", OK, 0.01, 2 * BAD),
    ]
    text = table(found)
    assert "5 sheets" in text
    assert "2 look bad (worst view over 1.7 %), 1 missed" in text
    assert "2 look fine (below 1.4 %), 1 false alarms" in text
    assert text.index("good") < text.index("alarm") < text.index("missed")
    assert draw_curve({"all": found}).startswith(b"\x89PNG")


def test_ranks_agree_or_do_not() -> None:
    rising = [judged(str(i), OK, 0.001 * i, 0.001 * i**2) for i in range(1, 6)]
    assert rank_correlation(rising) == pytest.approx(1)
    falling = [judged(str(i), OK, 0.001 * i, 0.001 / i) for i in range(1, 6)]
    assert rank_correlation(falling) == pytest.approx(-1)


def test_terms_that_tell_how_views_look_rank_characters_that_were_left_out() -> None:
    rng = np.random.default_rng(0)
    sheets = []
    for number in range(24):
        terms = rng.random(4)
        flip = float(terms @ [0.3, 0.0, 0.02, 0.01])
        name = f"{'abcd'[number % 4] * 3}{number}-four{OWN * (number % 3 == 0)}"
        sheets.append(Judged(name, OK, (), 0.01, (0.01,), tuple(terms.tolist()), (flip, flip)))
    found = {one.terms: one for one in told(sheets)}
    assert len(found) == 15
    whole = found[TERMS]
    assert (whole.rank, whole.rank_own, whole.rank_others) == pytest.approx((1, 1, 1))
    assert found["apart",].rank < 0.5
    assert told_text(sheets).splitlines()[-1].split()[:7] == [*TERMS, "1.00", "1.00", "1.00"]
    assert told(sheets[:3]) == []
    assert told_text(sheets[:3]) == ""
    assert character_of("aaa12-four-own") == character_of("aaa7-three") == "aaa"


def test_sheets_above_the_bound_of_other_characters_are_counted() -> None:
    def sheet(name: str, term: float, off: float = 0.0) -> Judged:
        return Judged(name, OK, (), off, (2 * BAD,), (term, 0, 0, 0), (term,))

    own = [sheet(f"{name}-{number}{OWN}", 0.1) for name in "abc" for number in range(3)]
    torn = [sheet("a-torn", 0.2), sheet("b-torn", 0.2, 2 * MOST_OFF), sheet("c-fine", 0.05)]
    found = {one.terms: one for one in told([*own, *torn])}["off",]
    assert (found.alarms, found.found) == (0, 1)
    found = {one.terms: one for one in told([*own, *torn, sheet(f"d{OWN}", 0.3)])}["off",]
    assert (found.alarms, found.found) == (1, 1)


def test_terms_are_none_of_views_as_whole_as_the_drawings() -> None:
    plain = BetweenView(0.0, (0.0, 1.0), 8.0, 8.0, 50.0, 50.0, 0, 2, 2, 0.0, 0.0, 0.0)
    assert terms_of(0.01, [plain]) == terms_of(0.01, []) == (0.01, 0, 0, 0)
    torn = replace(plain, apart=0.2, borders=100.0, outline=4.0)
    assert terms_of(0.01, [plain, torn]) == pytest.approx((0.01, 0.1, *[np.log(2) / 2] * 2))
    smooth = replace(plain, borders=30.0)
    assert terms_of(0.01, [smooth]) == (0.01, 0, 0, 0)  # fewer borders are no raggedness


def test_a_move_by_a_pixel_is_told_by_what_is_drawn() -> None:
    picture = np.ones((20, 20, 3), np.float32)
    picture[8:12, 8:12] = 0
    found = by_pixel(lambda a, b: np.abs(a - b).mean(axis=-1), picture)
    assert found.sum() == pytest.approx(8)  # four pixels on either side of either axis, halved
    assert by_pixel(lambda a, b: np.abs(a - b).mean(axis=-1), np.ones_like(picture)).sum() == 0


def test_a_second_run_judges_what_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[str] = []

    def judge(name: str, *_: object) -> tuple[Judged, bytes]:
        seen.append(name)
        return judged(name, OK, 0.01 * len(seen), 0.01), b"png"

    monkeypatch.setattr(command, "judge", judge)
    monkeypatch.setattr(command, "_drawn", lambda *_: (None, None, None))
    app = command.typer.Typer()
    app.command()(command.main)
    for seeds in ("1", "2"):
        arguments = ["-o", str(tmp_path), "--seeds", seeds, "--only", "train odd"]
        done = CliRunner().invoke(app, arguments)
        assert done.exit_code == 0, done.output
    assert seen == [f"train odd {s} s{n}" for n in (0, 1) for s in ODD]
    assert "seed 1" in done.output.splitlines()
    assert (tmp_path / "curve.png").read_bytes().startswith(b"\x89PNG")


ODD = ("flipped", "other pose", "other shirt")
