"""What `toonset calibrate` is given: drawings, a mannequin, and what is known of the cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from toonset.cli.common.cutting import Cutting
from toonset.cli.common.output import Printer
from toonset.cli.common.sheet_inputs import check_label_count, load_drawings

if TYPE_CHECKING:
    from toonset.calib.hints import Known
    from toonset.camera import Camera
    from toonset.dataset.mannequin.landmark_file import Landmarks
    from toonset.dataset.mannequin.options import MannequinOptions
    from toonset.mesh import Mesh
    from toonset.view import View

LEAST_HEIGHT = 0.01  # of the width; flatter, nothing can be told from its outline
SQUARE = 1e-3  # a pixel may be this much higher than wide: rounding of a file


@dataclass(frozen=True)
class Hints:
    """What the command line says of the views.

    Attributes:
        labels: of --views; empty for nothing.
        landmarks: landmark file.
        landmarks_only: no outline is fitted.
        init: bundle or transforms.json with cameras to start from.
        locked: what stays as given.
        cutting: how the sheets are cut.
    """

    labels: str = ""
    landmarks: Path | None = None
    landmarks_only: bool = False
    init: Path | None = None
    locked: tuple[str, ...] = ()
    cutting: Cutting = field(default_factory=Cutting)

    def check_usage(self) -> None:
        """Refuse what contradicts itself.

        Raises:
            BadParameter: --landmarks-only without --landmarks, or beside what it does not use.
            SheetError: an option that says how sheets are cut cannot be understood.
        """
        self.cutting.check_usage()
        if not self.landmarks_only:
            return
        if self.landmarks is None:
            raise typer.BadParameter("--landmarks-only needs --landmarks FILE")
        unused = {"--views": self.labels, "--init": self.init, "--lock": self.locked}
        for name, value in unused.items():
            if value:
                raise typer.BadParameter(f"{name} does nothing beside --landmarks-only; drop one")

    def as_options(self) -> dict[str, Any]:
        """Return what calibration.json keeps besides the files."""
        return {
            "views": self.labels or None,
            "landmarks_only": self.landmarks_only,
            "locked": list(self.locked),
            **self.cutting.as_options(),
        }


@dataclass(frozen=True, eq=False)
class Body:
    """The mannequin to fit.

    Attributes:
        mesh: its surface.
        path: its file; None for a made one.
        looks: proportions and pose of a made one.
        points: of a made one, by name.
    """

    mesh: Mesh
    path: Path | None = None
    looks: MannequinOptions | None = None
    points: dict[str, tuple[float, ...]] = field(default_factory=dict)

    def __str__(self) -> str:
        """Return what it is, for people."""
        if self.looks is None:
            return f"mannequin of {len(self.mesh.faces)} faces"
        return (
            f"no --mesh: the default mannequin, {self.looks.heads_tall:g} heads tall, "
            f"{self.looks.pose} pose (`toonset mannequin` makes others)"
        )

    def as_options(self) -> dict[str, Any]:
        """Return what calibration.json keeps of a made mannequin."""
        return {"mannequin": asdict(self.looks)} if self.looks is not None else {}


def load_body(path: Path | None) -> Body:
    """Return the mannequin of a file, or the default one.

    Raises:
        MeshError: the file is no mesh, or the mannequin lies.
    """
    if path is None:
        return _default_body()
    from toonset.dataset.mesh.load import load_mesh

    mesh = load_mesh(path)
    _check_upright(mesh)
    return Body(mesh, path)


@dataclass(frozen=True, eq=False)
class Sheets:
    """The drawings to fit.

    Attributes:
        views: named in order.
        labels: what each shows, as --views or a split folder says; empty for nothing.
        files: role and path of every file that the views depend on.
        papers: per view the colour of the sheet behind it; None where it is transparent, or where
            a person has had the chance to correct what was cut out (a split folder).
    """

    views: tuple[View, ...]
    labels: str
    files: tuple[tuple[str, Path], ...]
    papers: tuple[tuple[int, int, int] | None, ...]


def load_sheets(paths: Sequence[Path], hints: Hints, printer: Printer) -> Sheets:
    """Return the drawings of all sheets.

    Raises:
        PictureError, SheetError: see `load_drawings`; or --views has not one label per view.
    """
    drawings = load_drawings(paths, hints.cutting, printer)
    for doubt in drawings.doubts:
        printer.say(doubt)
    check_label_count(hints.labels, drawings)
    labels = hints.labels or drawings.split.label_text
    cut_now = [picture is not None for picture in drawings.pictures]
    papers = tuple(
        drawings.split.sources[sheet].background if cut_now[sheet] else None
        for sheet in drawings.split.source_of
    )
    return Sheets(drawings.split.views, labels, drawings.files, papers)


def load_known(hints: Hints, views: Sequence[View], body: Body) -> Known:
    """Return what is known of the views before they are looked at.

    Raises:
        ToonsetError: a label, a landmark file or cameras that do not belong to the views.
    """
    from toonset.calib.from_landmarks import landmarks_of_every_view
    from toonset.calib.hints import Known
    from toonset.calib.view_labels import parse_labels
    from toonset.dataset.mannequin.landmark_file import read_known_points, read_landmarks

    labels = parse_labels(hints.labels, len(views)) if hints.labels else ()
    landmarks: tuple[Landmarks | None, ...] = ()
    if hints.landmarks is not None:
        points = body.points if body.path is None else read_known_points(body.path)
        landmarks = read_landmarks(hints.landmarks, views, points)
    if hints.landmarks_only:
        landmarks_of_every_view(views, landmarks)
    cameras = _cameras(hints.init, views) if hints.init else ()
    known = Known(labels, landmarks, cameras, frozenset(hints.locked))
    known.check(views)
    return known


def _check_upright(mesh: Mesh) -> None:
    from toonset.errors import MeshError

    widths = mesh.bounds[1] - mesh.bounds[0]
    if widths[1] < LEAST_HEIGHT * max(widths):
        raise MeshError(
            f"{mesh.name}: {widths[1]:.3g} high (+Y is up) but {max(widths):.3g} wide; turn the "
            "mannequin upright and export it again"
        )


def _default_body() -> Body:
    from toonset.dataset.mannequin.make import default_mannequin
    from toonset.dataset.mannequin.options import MannequinOptions

    looks, made = MannequinOptions(), default_mannequin()
    points = {name: tuple(point.tolist()) for name, point in made.landmarks.items()}
    return Body(made.mesh, None, looks, points)


def _cameras(path: Path, views: Sequence[View]) -> tuple[Camera, ...]:
    """Return the cameras of --init; in the views' order where their names are the views'."""
    from toonset.dataset.bundle.transforms import read_cameras
    from toonset.errors import CameraError

    named = [(Path(name).name, camera) for name, camera in read_cameras(path)]
    names = [view.name for view in views]
    if sorted(name for name, _ in named) == names:
        named.sort(key=lambda frame: frame[0])
    for name, camera in named:
        if abs(camera.pixel_aspect - 1) > SQUARE:
            raise CameraError(
                f"--init: the camera of {name} has pixels {camera.pixel_aspect:.3g} times as high "
                "as wide, square ones are needed; give other cameras"
            )
    return tuple(camera for _, camera in named)
