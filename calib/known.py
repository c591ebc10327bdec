"""Hold what is known before calibration: labels, landmarks, initial cameras, locks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from toonset.calib.fit.tilt import tilt
from toonset.calib.outline.pose import Pose, project
from toonset.calib.search.candidates import Candidates
from toonset.camera import Camera, angles_from_rotation, rotation_from_angles
from toonset.dataset.mannequin.landmark_file import Landmarks
from toonset.dataset.split_folder.view_labels import Label
from toonset.errors import CameraError
from toonset.view import View

PAIR_OF_HEIGHT = 0.015  # error of a landmark under a candidate's camera, proportions included


@dataclass(frozen=True, eq=False)
class Known:
    """Prior knowledge of the views.

    Attributes:
        labels: possible yaws of every view; empty for nothing.
        landmarks: pairs of every view, None for a view without; empty for nothing.
        cameras: where to start, in pixels of the views' crops; empty to search.
        locked: which of `Lock` stay as `cameras` (or, for yaw, single labels) have them.
        placed: where a person put the cameras of single views, pixels of their crops, relative to
            the mannequin's middle; None for a view left alone; empty for nothing.
        kept: which views keep yaw and elevation of `placed`, or their label's yaw; empty for none.
    """

    labels: tuple[Label, ...] = ()
    landmarks: tuple[Landmarks | None, ...] = ()
    cameras: tuple[Camera, ...] = ()
    locked: frozenset[str] = frozenset()
    placed: tuple[Pose | None, ...] = ()
    kept: tuple[bool, ...] = ()

    @property
    def holds(self) -> bool:
        """Return whether an angle or a size is locked, of the sheet or of a view."""
        return bool(self.locked - {"fov"}) or any(self.kept)

    @property
    def is_labels(self) -> bool:
        """Return whether labels are all that is known."""
        more = self.landmarks or self.cameras or self.locked or self.placed or self.kept
        return any(self.labels) and not more

    def check(self, views: Sequence[View]) -> None:
        """Refuse what does not belong to the views or cannot be locked.

        Raises:
            CameraError: another number of cameras, another size, or a lock without its value.
        """
        if self.cameras and len(self.cameras) != len(views):
            raise CameraError(
                f"--init: {len(self.cameras)} cameras for {len(views)} views; give one per view"
            )
        for view, camera in zip(views, self.cameras, strict=False):
            size = (view.rgba.shape[1], view.rgba.shape[0])
            if camera.size_wh != size:
                raise CameraError(
                    f"--init: the camera of {view.name} is for {camera.size_wh[0]} x "
                    f"{camera.size_wh[1]} px, the view has {size[0]} x {size[1]}; give the cameras "
                    "of this sheet's own views"
                )
        for name in sorted(self.locked):
            by_label = name == "yaw" and bool(self.labels)
            if not self.cameras and not (by_label and all(len(lb) == 1 for lb in self.labels)):
                also = ", or one yaw per view in --views" if name == "yaw" else ""
                raise CameraError(f"--lock {name}: no value to keep; give --init{also}")

    def start_poses(self, middle: Float[np.ndarray, " 3"]) -> tuple[Pose, ...]:
        """Return the cameras to start from relative to the mannequin's middle."""
        return tuple(_pose(camera, middle) for camera in self.cameras)

    def yaws(self, middle: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " views"]:
        """Return the yaws to keep, radians."""
        if self.cameras:
            poses = self.start_poses(middle)
            return np.array([angles_from_rotation(pose.rotation)[0] for pose in poses])
        return np.array([label[0] for label in self.labels])

    @property
    def yaws_of_labels(self) -> Known:
        """Return the same with every view kept at its label's yaw if labels lock the yaws."""
        if "yaw" not in self.locked or self.cameras:
            return self
        views = len(self.labels)
        return replace(self, kept=(True,) * views, placed=self.placed or (None,) * views)

    def asked_yaws(self, views: int) -> Float[np.ndarray, " views"]:
        """Return the yaws at which a person put single views, radians; nan where nobody did."""
        yaws = np.full(views, np.nan)
        for i, pose in enumerate(self.placed):
            if pose is not None:
                yaws[i] = angles_from_rotation(pose.rotation)[0]
            elif self.kept and self.kept[i]:
                yaws[i] = self.labels[i][0]
        return yaws

    def kept_yaws(self, views: int) -> Float[np.ndarray, " views"]:
        """Return the yaws at which single views stay, radians; nan where a view is free."""
        return np.where(np.array(self.kept or (False,) * views), self.asked_yaws(views), np.nan)

    def locks(self, middle: Float[np.ndarray, " 3"]) -> dict[str, Float[np.ndarray, " views"]]:
        """Return yaw, elevation (radians) and log scale to keep; nan where a view is free."""
        poses = self.start_poses(middle)
        values: dict[str, Callable[[], Float[np.ndarray, " views"]]] = {
            "yaw": lambda: self.yaws(middle),
            "elevation": lambda: np.array([tilt(pose)[0][1] for pose in poses]),
            "scale": lambda: np.log([pose.scale for pose in poses]),
        }
        found = {name: values[name]() for name in sorted(self.locked - {"fov"})}
        if any(self.kept):
            own = [tilt(pose)[0][1] if pose else np.nan for pose in self.placed]
            found.setdefault("yaw", self.kept_yaws(len(own)))
            found.setdefault("elevation", np.where(self.kept, own, np.nan))
        return found

    def at_locks(self, poses: Sequence[Pose], middle: Float[np.ndarray, " 3"]) -> tuple[Pose, ...]:
        """Return the poses turned to the yaws to keep; kept views to their elevation, too.

        Steps are limited: a lock keeps an angle, but does not bring a far one there.
        """
        yaws = self.locks(middle).get("yaw", np.full(len(poses), np.nan))
        turned = list(poses)
        for i, yaw in enumerate(yaws.tolist()):
            if not np.isfinite(yaw):
                continue
            _, elevation, roll = angles_from_rotation(poses[i].rotation)
            own = self.placed[i] if self.kept and self.kept[i] else None
            if own is not None:
                elevation = tilt(own)[0][1]
            rotation = rotation_from_angles(yaw, elevation, roll)
            turned[i] = replace(poses[i], rotation=rotation)
        return tuple(turned)


def weighed_by_landmarks(
    view: Candidates, landmarks: Landmarks | None, middle: Float[np.ndarray, " 3"], height_px: float
) -> Candidates:
    """Return the candidates with what the landmarks say added to their energies.

    Heavy tails: a pair may be misplaced.
    """
    if landmarks is None:
        return view
    sigma = PAIR_OF_HEIGHT * height_px
    costs = []
    for fit in view.fits:
        off = project(fit.pose, landmarks.world - middle) - landmarks.pixels
        costs.append(2.0 * np.log1p((off**2).sum(axis=1) / sigma**2 / 3.0).sum())
    return replace(view, energies=view.energies + np.array(costs) - min(costs))


def _pose(camera: Camera, middle: Float[np.ndarray, " 3"]) -> Pose:
    """Return the camera turned to look at the middle, which appears where it did."""
    pixels, depth, in_front = camera.project(middle[None])
    if not in_front[0]:
        raise CameraError("--init: the mannequin is behind a camera; give cameras that look at it")
    relative = 1 + camera.k * float(depth[0])
    rotation = camera.rotation
    if camera.k > 0:
        ahead = rotation @ (middle - camera.world_from_camera[:3, 3])
        rotation = _turn_to_axis(ahead) @ rotation
    return Pose(rotation, pixels[0], camera.scale / relative, camera.k / relative)


def _turn_to_axis(direction: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """Return the smallest rotation that takes a direction to the optical axis."""
    x, y, z = direction / np.linalg.norm(direction)
    cross = np.array([[0, 0, -x], [0, 0, -y], [x, y, 0.0]])  # of the axis direction x e_z
    return np.eye(3) + cross + cross @ cross / (1 + z)
