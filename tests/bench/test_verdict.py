"""The bench of the verdict: what it is measured on, and that counts are right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import bench.verdict.__main__ as command
from bench.verdict.curve import BAD, FINE, draw_curve, rank_correlation, table
from bench.verdict.fit import character_of, fit_text, fitted
from bench.verdict.measure import Judged, by_pixel
from toonset.nerf.score.verdict import OK, WEAK


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


def test_weights_are_found_again_and_each_character_is_left_out() -> None:
    rng = np.random.default_rng(0)
    wanted = np.array([0.3, 0.0, 0.02, 0.01])
    sheets = []
    for number in range(12):
        terms = rng.random(4)
        look = float(terms @ wanted)
        name = f"{'abcd'[number % 4] * 3}{number}-four"
        sheets.append(Judged(name, OK, (), terms[0], (look, look), tuple(terms.tolist())))
    found = fitted(sheets)
    assert found is not None
    np.testing.assert_allclose(found.weights, wanted, atol=1e-6)
    assert found.rank == pytest.approx(1)
    assert found.error == pytest.approx(0, abs=1e-6)
    assert "off      0.3000" in fit_text(sheets)
    assert fitted(sheets[:3]) is None
    assert fit_text(sheets[:3]) == ""
    assert character_of("aaa12-four-own") == character_of("aaa7-three") == "aaa"


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
