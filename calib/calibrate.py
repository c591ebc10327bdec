"""Calibrate a sheet's cameras: everything `toonset calibrate` does between reading and writing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from toonset.calib.captions import weigh_captions
from toonset.calib.find_cameras import find_cameras
from toonset.calib.flaws.cropped import at_cuts
from toonset.calib.flaws.false_holes import fill_false_holes
from toonset.calib.from_landmarks import calibrate_by_landmarks
from toonset.calib.hints import check_hints, known_of
from toonset.calib.known import Known
from toonset.calib.options import CalibrationOptions, Hints, Progress
from toonset.calib.result import Calibration
from toonset.calib.verdict.checks import check_names, off_labels
from toonset.calib.without_body.cues import Cues
from toonset.calib.without_body.find import calibrate_without_body
from toonset.calib.without_body.mannequin_world import in_mannequin_world
from toonset.calib.without_body.rival import tells_directions, with_body_or_without
from toonset.dataset.bundle.transforms_read import transforms_file
from toonset.dataset.mannequin.files import landmarks_path
from toonset.dataset.mannequin.landmark_file import read_known_points
from toonset.dataset.mannequin.make import Mannequin, default_mannequin
from toonset.dataset.mannequin.options import MannequinOptions
from toonset.dataset.split_folder.view_labels import parse_labels
from toonset.errors import MeshError, UsageError
from toonset.mesh import Mesh
from toonset.options import Body
from toonset.view import InputFile, View

LEAST_HEIGHT = 0.01  # of the width; flatter, nothing can be told from its outline
AS_LABELLED = np.radians(12.0)  # artists draw what they call a side up to so far off it
PACKAGES = ("toonset", "numpy", "scipy", "opencv-contrib-python-headless")


def calibrate(
    views: Sequence[View],
    body: Mesh | Body = Body.DEFAULT,
    hints: Hints = Hints(),
    *,
    progress: Progress = lambda step, share: None,
    cues: Cues | None = None,
    options: CalibrationOptions = CalibrationOptions(),
) -> Calibration:
    """Return one camera per drawing, with how sure it is.

    BLAS works on one thread meanwhile; the same input gives the same numbers on any
    number of cores.

    Args:
        views: the drawings, at least one, as `split_sheet` cuts them out.
        body: the posed mannequin; its frame and units become the world's, even where it is refused
            as another body and cameras come from the drawings. Or what stands in for one.
        hints: what is known of the views.
        progress: called with the step's name and the share of it that is done.
        cues: what an earlier call has found in the same drawings, and keeps what this one finds;
            those of other drawings are passed over.
        options: how hard to look and what to doubt (`toonset.calib.options`); recorded with the
            result, thresholds and checks where they differ from the default.

    Raises:
        ToonsetError: no view, two of one name, a mannequin that lies, a check that does not exist,
            or hints that contradict each other or do not belong to the views or the mannequin.
    """
    check_hints(hints)
    check_names(options.without)
    _check_view_names([view.name for view in views])
    if cues is None or not cues.are_of(views):
        cues = Cues(views)

    def as_said(hints: Hints) -> Calibration:
        return _calibrate(views, body, hints, progress, cues, options)

    found, captions = as_said(hints), hints.captions_of(views)
    if not captions:
        return found
    labels = parse_labels(captions, len(views))
    labelled = replace(hints, labels=captions)
    weighed = weigh_captions(found, labels, lambda: as_said(labelled), options.thresholds)
    said = {**weighed.origin["options"], "views": None, "captions": captions}
    return replace(weighed, origin={**weighed.origin, "options": said})


def _calibrate(
    views: Sequence[View],
    given: Mesh | Body,
    hints: Hints,
    progress: Progress,
    cues: Cues,
    options: CalibrationOptions,
) -> Calibration:
    """Return one camera per drawing by the drawings and the hints alone."""
    if given is Body.NONE:
        known = _known_without_body(hints, views)
        with threadpool_limits(1, user_api="blas"):
            alone = calibrate_without_body(views, known, progress, cues, options)
            return _alone(views, alone, hints, options)
    mesh = given if isinstance(given, Mesh) else None
    body = _Mannequin.of(mesh)
    known = known_of(hints, views, body.points_for(hints))
    with threadpool_limits(1, user_api="blas"):  # more only wait, and change the last digits
        if hints.landmarks_only:
            found = calibrate_by_landmarks(views, body.mesh, known.landmarks, options.thresholds)
        else:
            first: Calibration | None = None
            if mesh is None and tells_directions(views, known):
                first = calibrate_without_body(views, known, progress, cues, options)
                if first.is_certain:
                    return _alone(views, first, hints, options)
            found = find_cameras(views, body.mesh, options, progress, known)
            if mesh is not None and known.is_labels and not found.is_certain:
                found = _unlabelled_if_better(views, body.mesh, found, known, options, progress)
            found, has_no_body = with_body_or_without(
                views,
                found,
                known,
                given=mesh is not None,
                tell=progress,
                cues=cues,
                options=options,
                alone=first,
            )
            if has_no_body and mesh is None:
                return _alone(views, found, hints, options)
            if has_no_body:
                origin = _origin(views, body, hints, options)
                refused = in_mannequin_world(found, views, body.mesh)
                return replace(refused, drawings=tuple(views), origin=origin)
    drawings, found = at_cuts(views, found)
    drawings, filled = fill_false_holes(drawings, found.views, found.mannequin)
    return replace(
        found,
        filled_holes=filled,
        drawings=drawings,
        mesh=body.mesh,
        origin=_origin(views, body, hints, options),
    )


def _unlabelled_if_better(
    views: Sequence[View],
    mesh: Mesh,
    labelled: Calibration,
    known: Known,
    options: CalibrationOptions,
    progress: Progress,
) -> Calibration:
    """Return the cameras found without the labels if those say the same and lower the verdict.

    A label pulls cameras to round angles, and what is an alternative by 5 % is one by 6 % then.
    """
    found = find_cameras(views, mesh, options, progress)
    agree = off_labels(found.views, known.labels).max() <= AS_LABELLED
    return found if agree and found.doubtfulness < labelled.doubtfulness else labelled


def _known_without_body(hints: Hints, views: Sequence[View]) -> Known:
    size = next((name for name in hints.lock if name != "yaw"), None)
    for name, value in {
        "--landmarks": hints.landmarks,
        "--init": hints.init,
        f"--lock {size}": size,
    }.items():
        if value:
            raise UsageError(f"{name} needs a mannequin; drop it or --mesh none")
    known = known_of(hints, views, {})
    if known.landmarks:
        raise UsageError("landmarks need a mannequin; drop them or --mesh none")
    return known


def _alone(
    views: Sequence[View], found: Calibration, hints: Hints, options: CalibrationOptions
) -> Calibration:
    """Return a calibration without a body with its drawings and where it comes from."""
    return replace(found, drawings=tuple(views), origin=_origin(views, None, hints, options))


@dataclass(frozen=True, eq=False)
class _Mannequin:
    """The mannequin to fit; `given` is the user's, None for the default, made when first used."""

    given: Mesh | None

    @classmethod
    def of(cls, mesh: Mesh | None) -> _Mannequin:
        if mesh is not None:
            _check_upright(mesh)
        return cls(mesh)

    @cached_property
    def _default(self) -> Mannequin:
        return default_mannequin()

    @property
    def mesh(self) -> Mesh:
        """Return its surface."""
        return self._default.mesh if self.given is None else self.given

    @property
    def looks(self) -> MannequinOptions | None:
        """Return proportions and pose of one made by code; None for a user's."""
        return MannequinOptions() if self.given is None else None

    def points_for(self, hints: Hints) -> Mapping[str, Sequence[float]]:
        """Return the named points that a landmark file may speak of."""
        if hints.landmarks is None:
            return {}
        if self.given is None:
            return {name: tuple(at.tolist()) for name, at in self._default.landmarks.items()}
        if self.given.path is None:
            return {}
        return read_known_points(self.given.path, self.given.world_from_file)


def _check_upright(mesh: Mesh) -> None:
    widths = mesh.bounds[1] - mesh.bounds[0]
    if widths[1] < LEAST_HEIGHT * max(widths):
        raise MeshError(
            f"{mesh.name}: {widths[1]:.3g} high (+Y is up) but {max(widths):.3g} wide; turn the "
            "mannequin upright and export it again"
        )


def _check_view_names(names: Sequence[str]) -> None:
    if not names:
        raise UsageError("calibrate: no view; give the views of `split_sheet`")
    double = next((name for name in names if names.count(name) > 1), None)
    if double:
        raise UsageError(
            f"calibrate: two views are called {double}; split all sheets in one call of "
            "`split_sheet`, which numbers them through"
        )


def _origin(
    views: Sequence[View], body: _Mannequin | None, hints: Hints, options: CalibrationOptions
) -> dict[str, Any]:
    """Return what calibration.json says of where its cameras come from."""
    origins = list(dict.fromkeys(view.origin for view in views if view.origin is not None))
    files = [file for origin in origins for file in origin.files]
    if body is not None and body.mesh.path is not None and body.mesh.sha256:
        files.append(InputFile("mesh", body.mesh.path.name, body.mesh.sha256))
    mesh = None if body is None else body.mesh
    said = [InputFile.of(*each) for each in _hint_files(mesh, hints)]
    files += [file for file in said if file not in files]  # corrections may be the sheet's, too
    cut = origins[0].options if origins else {}
    turned = {} if mesh is None or mesh.up == "y" else {"up": mesh.up}
    made = {} if body is None or body.looks is None else {"mannequin": asdict(body.looks)}
    return {
        "options": _recorded(options) | hints.as_options(views) | dict(cut) | made | turned,
        "versions": {name: version(name) for name in PACKAGES},
        "inputs": [  # views may come from files of the same name in several folders
            {"name": file.name, "sha256": file.sha256, "role": file.role} for file in files
        ],
    }


def _recorded(options: CalibrationOptions) -> dict[str, Any]:
    """Return the search effort, and of what is doubted what differs from the default."""
    said, usual = asdict(options), asdict(CalibrationOptions())
    doubts = {
        name: value
        for name, value in said.pop("thresholds").items()
        if value != usual["thresholds"][name]
    }
    without = list(said.pop("without"))
    return said | {k: v for k, v in {"thresholds": doubts, "without": without}.items() if v}


def _hint_files(mesh: Mesh | None, hints: Hints) -> list[tuple[str, Path]]:
    """Return role and path of every file that says what is known."""
    files = []
    if hints.landmarks is not None:
        files.append(("landmarks", Path(hints.landmarks)))
        if mesh is not None and mesh.path is not None and landmarks_path(mesh.path).exists():
            files.append(("points of the mesh", landmarks_path(mesh.path)))
    if hints.corrections is not None:
        files.append(("corrections", Path(hints.corrections)))
    if hints.init is not None:
        files.append(("init", transforms_file(Path(hints.init))))
    return files
