"""What `train` says at its end about drawings that were, or were not, set right."""

from pathlib import Path
from typing import Any

from toonset.cli.common.train_summary import summary


def metrics(**drawings: dict[str, Any] | bool | None) -> dict[str, Any]:
    figures = {"psnr": 30.0, "psnr_mask": None}
    return {
        "train": figures,
        "test": None,
        "steps": 3,
        "seconds": {"steps": 1.0},
        "counts": {"views": 8, "rays": 9, "parameters": 7},
        "hull": {"missing": 0, "left_out_iou": []},
        "symmetry": None,
        "planes": None,
        "verdict": {
            "verdict": "weak",
            "off_height": {
                "worst": 0.027,
                "bound": 0.019,
                "views": {"a.png": 0.01, "b.png": 0.027},
            },
        },
        "drawings": dict.fromkeys(("mannequin", "registration", "unwarping", "without_outlines"))
        | drawings,
    }


def step(gain_nats: float, *, applied: bool) -> dict[str, Any]:
    return {"applied": applied, "gain_nats": gain_nats, "apart_px": (1.0, 0.5)}


def test_evidence_that_was_not_acted_on_is_called_so() -> None:
    found = summary(
        Path("run"),
        metrics(registration=step(70, applied=False), unwarping=step(90, applied=True)),
        verbose=True,
    ).splitlines()
    apart = "drawings not moved and sized: outlines 1.00 px apart"
    assert f"{apart} (+70 nats, not the best explanation)" in found
    assert "drawings bent back: outlines 1.00 px apart, 0.50 px after (+90 nats)" in found
    assert "fit to the drawings as set right: PSNR 30.00 dB" in found


def test_the_verdict_is_there_with_what_it_rests_on() -> None:
    (line,) = (
        x for x in summary(Path("run"), metrics(), True).splitlines() if x.startswith("verdict")
    )
    assert line.startswith("verdict: weak; b.png is off by 2.70 % of the height")
    assert "1.90 % is ok" in line


def test_drawings_that_agree_are_fitted_as_they_are() -> None:
    assert "fit to the drawings: PSNR 30.00 dB" in summary(
        Path("run"), metrics(registration=step(-5, applied=False))
    )


def test_few_drawings_are_fitted_without_their_outlines() -> None:
    found = summary(Path("run"), metrics(without_outlines=True))
    assert "fit to the drawings without their outlines: PSNR 30.00 dB" in found


def test_evidence_is_for_those_who_ask() -> None:
    drawn = metrics(registration=step(-5, applied=False), unwarping=step(90, applied=True))
    assert summary(Path("run"), drawn).splitlines() == [
        "8 views; 3 steps in 1.0 s",
        "drawings bent back: outlines 1.00 px apart, 0.50 px after",
        "fit to the drawings as set right: PSNR 30.00 dB",
        "verdict: weak",
        "run: look at preview.png; next: toonset view run",
    ]


def test_it_says_whether_the_mannequin_gives_the_shape() -> None:
    fit = {"mannequin_off": 0.006, "drawings_off": 0.011, "parts_left": 0.0}
    body = metrics(mannequin=fit | {"chosen": True}, unwarping=step(90, applied=True))
    lines = summary(Path("run"), body).splitlines()
    assert lines[1] == "shape: the mannequin's"
    assert lines[2] == "drawings bent to the mannequin: outlines 1.00 px apart, 0.50 px after"
    loud = summary(Path("run"), body, verbose=True)
    assert "outlines predicted 0.60 % off, by the other drawings 1.10 %" in loud
    assert "hull: filled" not in loud
    other = metrics(mannequin=fit | {"chosen": False, "drawings_off": None})
    assert "shape" not in summary(Path("run"), other)
    assert "the mannequin is another body" in summary(Path("run"), other, verbose=True)
