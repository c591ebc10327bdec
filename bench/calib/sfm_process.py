"""COLMAP on a folder of pictures, as a process: `python -m bench.calib.sfm_process FOLDER`.

Reads FOLDER/images and FOLDER/request.json (`bench.calib.sfm.SfmOptions` and a seed), writes
FOLDER/answer.json: the rotations of the largest model.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pycolmap

from toonset.dataset.images.picture import picture_size
from toonset.write import write_json

ONLY_FATAL = 3  # pycolmap's log level
FEWEST = 8  # matches: the least from which an epipolar geometry is estimated with any check
FEW_FOR_A_START = 15
LARGEST_FOCAL_RATIO = 1000.0  # of the picture: COLMAP's 10 would refuse the far cameras


def main(folder: Path) -> None:
    """Reconstruct and write the answer."""
    pycolmap.logging.minloglevel = ONLY_FATAL
    request = json.loads((folder / "request.json").read_text(encoding="utf-8"))
    pycolmap.set_random_seed(request["seed"])
    _match(folder, request)
    (folder / "models").mkdir()
    places = (folder / "matches.db", folder / "images", folder / "models")
    if request["mapper"] == "global":
        models = pycolmap.global_mapping(*places, _global_options(request))
    else:
        models = pycolmap.incremental_mapping(*places, _incremental_options(request))
    largest = max(models.values(), key=lambda model: model.num_reg_images(), default=None)
    write_json(folder / "answer.json", _answer(largest))


def _answer(model: Any) -> dict[str, Any]:
    if model is None:
        return {"rotations": {}, "points": 0}
    posed = {
        str(int(Path(image.name).stem)): image.cam_from_world().rotation.matrix().tolist()
        for image in model.images.values()
        if image.has_pose
    }
    return {"rotations": posed, "points": model.num_points3D()}


def _match(folder: Path, request: dict[str, Any]) -> None:
    """Find features (SIFT) and match every pair of pictures, on the CPU."""
    reader = pycolmap.ImageReaderOptions()
    reader.camera_model = "SIMPLE_PINHOLE"
    if request["focal_heights"]:
        width, height = picture_size(folder / "images" / "000.png")
        focal = request["focal_heights"] * height
        reader.camera_params = f"{focal},{width / 2},{height / 2}"
    features = pycolmap.FeatureExtractionOptions()
    matching = pycolmap.FeatureMatchingOptions()
    # the order in which pictures and pairs are done decides what is mapped first
    features.num_threads = matching.num_threads = 1
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = request["seed"]
    if request["permissive"]:
        features.sift.peak_threshold /= 3  # flat colours have little contrast inside
        features.sift.edge_threshold *= 2  # and lines for corners
        matching.sift.max_ratio = 0.9
        matching.guided_matching = True
        verification.min_num_inliers = FEWEST
        verification.detect_watermark = False  # equal white margins look like one
    database, device = folder / "matches.db", pycolmap.Device.cpu
    pycolmap.extract_features(
        database,
        folder / "images",
        camera_mode=pycolmap.CameraMode.SINGLE,
        reader_options=reader,
        extraction_options=features,
        device=device,
    )
    pycolmap.match_exhaustive(
        database, matching_options=matching, verification_options=verification, device=device
    )


def _incremental_options(request: dict[str, Any]) -> Any:
    options = pycolmap.IncrementalPipelineOptions()
    options.random_seed = options.mapper.random_seed = request["seed"]
    options.num_threads = options.mapper.num_threads = 1
    options.min_model_size = 2
    if request["permissive"]:
        options.min_num_matches = FEWEST
        options.mapper.init_min_num_inliers = FEW_FOR_A_START
        options.mapper.init_min_tri_angle = 4.0
        options.mapper.abs_pose_min_num_inliers = FEWEST
        options.mapper.abs_pose_min_inlier_ratio = 0.1
        options.triangulation.ignore_two_view_tracks = False
    if request["focal_heights"]:
        options.ba_refine_focal_length = False
        options.mapper.abs_pose_refine_focal_length = False
        for stage in (options, options.mapper, options.triangulation):
            stage.max_focal_length_ratio = LARGEST_FOCAL_RATIO
    return options


def _global_options(request: dict[str, Any]) -> Any:
    options = pycolmap.GlobalPipelineOptions()
    options.random_seed = options.mapper.random_seed = request["seed"]
    options.num_threads = options.mapper.num_threads = 1
    options.min_model_size = 2
    if request["permissive"]:
        options.min_num_matches = FEWEST
        options.mapper.track_min_num_views_per_track = 2
        options.mapper.global_positioning.min_num_view_per_track = 2
        options.mapper.bundle_adjustment.min_track_length = 2
        options.mapper.retriangulation.ignore_two_view_tracks = False
    if request["focal_heights"]:
        options.mapper.bundle_adjustment.refine_focal_length = False
    return options


if __name__ == "__main__":
    main(Path(sys.argv[1]))
