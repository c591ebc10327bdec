"""Check `--to nerfstudio`, `blender-synthetic` and `colmap` with nerfstudio's own data parsers.

    uv venv --python 3.10 /tmp/ns && uv pip install --python /tmp/ns/bin/python nerfstudio
    toonset export BUNDLE --to nerfstudio -o a 2> a.txt
    toonset export BUNDLE --to nerfstudio --pinholes -o p 2> p.txt
    toonset export BUNDLE --to colmap --layout old -o b
    /tmp/ns/bin/python lab/consumers/check_nerfstudio.py a p b

A folder of `--to nerfstudio` is parsed with the very line that its export printed, which a.txt
holds; all views must be there to train on and to evaluate.

Projects 1,000 points per view through the cameras that the parser returns (float32). For
orthographic ones (ORTHOPHOTO) it takes the rays that nerfstudio makes of the points' pixels, and
measures how far they miss the points. Measured with nerfstudio 1.1.5, torch 2.15 (the README's
example, 8 views): at most 0.00007 px, and 0.0003 px with --pinholes; without points, for Open3D was
missing. Pinholes before (3 bundles, 22 views, and COLMAP in both layouts, binary and text): at most
0.00003 px, far ones 0.0006 px.
"""

from __future__ import annotations

import shlex
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from exported import pixels, points_around, read_views, report

PARSERS = "nerfstudio.data.dataparsers"
ORTHOPHOTO = 8  # of its CameraType
NEAR = 0.05  # nerfacto's near plane, world units
AS_IT_IS = {"orientation_method": "none", "center_method": "none", "auto_scale_poses": False}


def parser_of(folder: Path) -> Any:
    """Return the parser of the folder's format."""
    if (folder / "transforms_train.json").is_file():
        module = import_module(f"{PARSERS}.blender_dataparser")
        config = module.BlenderDataParserConfig(data=folder)
    elif (folder / "sparse").is_dir():
        module = import_module(f"{PARSERS}.colmap_dataparser")
        config = module.ColmapDataParserConfig(
            data=folder,
            colmap_path=Path("sparse/0"),
            downscale_factor=1,
            assume_colmap_world_coordinate_convention=False,
            eval_mode="all",
            **AS_IT_IS,
        )
    else:
        methods = import_module("nerfstudio.configs.method_configs").AnnotatedBaseConfigUnion
        config = import_module("tyro").cli(methods, args=printed(folder))
        config = config.pipeline.datamanager.dataparser
    return config.setup()


def printed(folder: Path) -> list[str]:
    """Return the arguments of the nerfstudio line that the export of a folder has printed."""
    line = next(line for line in folder.with_suffix(".txt").open() if "ns-train " in line)
    return shlex.split(line.partition("ns-train ")[2])


def projected(cameras: Any, index: int, points: np.ndarray) -> np.ndarray:
    """Return pixels as nerfstudio's cameras have them: OpenGL axes, centres at .5."""
    pose = cameras.camera_to_worlds[index].double().numpy()
    local = (points - pose[:, 3]) @ pose[:, :3]
    u = float(cameras.fx[index]) * local[:, 0] / -local[:, 2] + float(cameras.cx[index])
    v = float(cameras.fy[index]) * -local[:, 1] / -local[:, 2] + float(cameras.cy[index])
    return np.stack([u, v], axis=1)


def passed_by(cameras: Any, index: int, points: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Return by how many pixels the rays of pixels miss points, by nerfstudio's own rays."""
    torch = import_module("torch")
    coords = torch.tensor(pixels[:, ::-1].copy(), dtype=torch.float32)  # v, u
    rays = cameras.generate_rays(torch.full((len(points), 1), index), coords=coords)
    ahead, start = rays.directions.double().numpy(), rays.origins.double().numpy()
    along = ((points - start) * ahead).sum(axis=1, keepdims=True)
    assert (along > NEAR).all()
    off = np.linalg.norm(points - start - along * ahead, axis=1)
    return off * float(cameras.fx[index])


def check(folder: Path) -> bool:
    """Compare every view of a folder; all must be there."""
    parser, views, off = parser_of(folder), read_views(folder), []
    outputs = parser.get_dataparser_outputs("train")
    assert len(outputs.image_filenames) == len(views)
    assert parser.get_dataparser_outputs("val").image_filenames
    for index, file in enumerate(outputs.image_filenames):
        view = views[Path(file).name]
        points = points_around(view)
        if int(outputs.cameras.camera_type[index]) == ORTHOPHOTO:
            exact = pixels(view, points, far_pinhole=False)
            off.append(float(passed_by(outputs.cameras, index, points, exact).max()))
            continue
        expected = pixels(view, points, far_pinhole=True)
        off.append(float(np.abs(projected(outputs.cameras, index, points) - expected).max()))
    return report(f"{folder} in nerfstudio", off)


if __name__ == "__main__":
    sys.exit(not all([check(Path(name)) for name in sys.argv[1:]]))
