"""The planes that a training chooses, beside fixed ones."""

from __future__ import annotations

from bench.train.choice import choices_of, choices_text
from bench.train.plan import METHODS, PLANES
from bench.train.run import RunResult
from toonset.nerf.train.resolution_choice import COARSE, FINE, USUAL


def run(method: str, psnr: float, parameters: int, case: str = "a", seed: int = 0) -> RunResult:
    return RunResult("exact", method, case, seed, {"psnr": psnr}, 1.0, 1.0, 0.1, parameters, ())


def runs(default: float, size: int, case: str = "a") -> list[RunResult]:
    fixed = zip(PLANES, (30.0, 30.2, 29.0), (900, 400, 225), strict=True)
    return [run("default", default, size, case), *(run(*entry, case) for entry in fixed)]


def test_the_chosen_field_stands_beside_the_best_fixed_one() -> None:
    near, far = choices_of([*runs(30.1, 400), *runs(29.7, 900, "b")])
    assert (near.case, near.best, round(near.behind_db, 3)) == ("a", "planes of 2/3", 0.1)
    assert near.share == 400 / 900
    assert (round(far.behind_db, 3), far.share) == (0.5, 1)
    text = choices_text([near, far]).splitlines()
    assert text[0] == (
        "exact: the chosen planes are within 0.3 dB of the best fixed ones on 1 of 2 characters, "
        "and smaller than the finest on 1"
    )
    assert text[1] == "  a: -0.10 dB beside planes of 2/3, 44 % of the finest planes' parameters"


def test_only_seeds_that_all_have_are_compared() -> None:
    (entry,) = choices_of([*runs(30.1, 400), run("default", 20.0, 400, seed=1)])
    assert round(entry.behind_db, 3) == 0.1


def test_nothing_is_said_without_fixed_fields() -> None:
    assert choices_of([run("default", 30.0, 400)]) == []
    assert choices_text([]) == ""


def test_fixed_fields_are_all_that_a_training_may_choose() -> None:
    assert {FINE, USUAL, COARSE} == set(PLANES.values())
    assert all(METHODS[name].share == share for name, share in PLANES.items())
