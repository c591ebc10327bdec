"""Projection in NumPy, pose by pose, against kornia and torch, all poses of a sheet at once.

`python -m bench.calib.projection` prints milliseconds per iteration of the search (views x starts
poses; every pose projects its fold ends, and its matched points with derivatives) and the seconds
that importing either costs. This is why `toonset calibrate` does not import torch.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from toonset.calib.outline.pose import Pose, project, project_with_jacobian
from toonset.camera import rotation_from_angles

if TYPE_CHECKING:
    import torch

FOLD_ENDS = 2000  # of a mannequin of 5,000 faces
MATCHES = 320  # of a view at the search's working scale
THREADS = 2


@dataclass(frozen=True)
class Row:
    """One way's milliseconds per iteration, and its largest difference from NumPy's pixels."""

    name: str
    fold_ends_ms: float
    derivatives_ms: float
    off_px: float


def compare(views: int = 8, starts: int = 13, repeats: int = 20, seed: int = 0) -> list[Row]:
    """Return the rows of NumPy and of torch in double and single precision."""
    import torch

    torch.set_num_threads(THREADS)
    rng = np.random.default_rng(seed)
    poses = [_random_pose(rng) for _ in range(views * starts)]
    ends = rng.uniform(-1, 1, (len(poses), FOLD_ENDS, 3))
    met = ends[:, :MATCHES]
    plain = np.stack([project(p, x) for p, x in zip(poses, ends, strict=True)])
    rows = [
        Row(
            "numpy, pose by pose",
            _ms(lambda: [project(p, x) for p, x in zip(poses, ends, strict=True)], repeats),
            _ms(
                lambda: [project_with_jacobian(p, x) for p, x in zip(poses, met, strict=True)],
                repeats,
            ),
            0.0,
        )
    ]
    for dtype in (torch.float64, torch.float32):
        pixels, slopes = _torch_ways(poses, ends, met, dtype)
        off = float(np.abs(pixels().double().numpy() - plain).max())
        name = f"kornia/torch batched, {str(dtype).removeprefix('torch.')}"
        rows.append(Row(name, _ms(pixels, repeats), _ms(slopes, repeats), off))
    return rows


def import_seconds(module: str) -> float:
    """Return the seconds that a fresh interpreter needs to import `module`."""
    code = f"import time; t = time.perf_counter(); import {module}; print(time.perf_counter() - t)"
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    return float(answer.stdout)


def _random_pose(rng: np.random.Generator) -> Pose:
    rotation = rotation_from_angles(*rng.uniform(-1, 1, 3) * [np.pi, 0.5, 0.1])
    return Pose(rotation, rng.uniform(50, 100, 2), rng.uniform(30, 60), 0.1)


def _torch_ways(
    poses: list[Pose],
    ends: Float[np.ndarray, "poses ends 3"],
    met: Float[np.ndarray, "poses matches 3"],
    dtype: torch.dtype,
) -> tuple[Callable[[], torch.Tensor], Callable[[], list[torch.Tensor]]]:
    """Return functions of all poses' pixels and of their derivatives by the seven unknowns."""
    import torch

    from toonset import projection

    def tensor(values: object) -> torch.Tensor:
        return torch.as_tensor(np.asarray(values)).to(dtype)

    rotation, shift = tensor([p.rotation for p in poses]), tensor([p.shift for p in poses])
    scale, k = tensor([p.scale for p in poses]), tensor([p.k for p in poses])
    ends_t, met_t = tensor(ends), tensor(met)

    def at(step: torch.Tensor) -> torch.Tensor:  # (poses, 7): each row moves its own pose only
        turned = projection.rotate(rotation, step[:, :3])
        grown = (scale * step[:, 5].exp())[:, None].expand(-1, 2)
        return projection.project_offsets(
            turned, shift + step[:, 3:5], grown, k + step[:, 6], met_t
        )

    def slopes() -> list[torch.Tensor]:
        zero = torch.zeros(len(poses), 7, dtype=rotation.dtype)
        along = [torch.zeros_like(zero).index_fill_(1, torch.tensor(i), 1) for i in range(7)]
        return [torch.func.jvp(at, (zero,), (direction,))[1] for direction in along]

    both = scale[:, None].expand(-1, 2)
    return lambda: projection.project_offsets(rotation, shift, both, k, ends_t), slopes


def _ms(work: Callable[[], object], repeats: int) -> float:
    """Return the median milliseconds of `work` after one warm-up."""
    work()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return 1e3 * float(np.median(times))


def main() -> None:
    """Print the table."""
    print(f"8 views x 13 starts, {FOLD_ENDS} fold ends, {MATCHES} matches, {THREADS} threads")
    for row in compare():
        print(
            f"{row.name:32s} fold ends {row.fold_ends_ms:7.2f} ms   with derivatives "
            f"{row.derivatives_ms:7.2f} ms   off by {row.off_px:.1e} px"
        )
    for module in ("toonset.calib.outline.pose", "toonset.projection"):
        print(f"import {module:25s} {import_seconds(module):5.2f} s")


if __name__ == "__main__":
    main()
