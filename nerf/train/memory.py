"""How much memory a training will take, how much there is, and what to say when it runs out."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import numpy as np
import torch
import torch.nn.functional as F

from toonset.dataset.bundle.scene import Scene
from toonset.errors import BundleError
from toonset.nerf.hull.scene_hull import VOXELS, VOXELS_PER_PX, per_px
from toonset.nerf.options import TrainOptions
from toonset.nerf.train.batches import MOST_RAYS
from toonset.nerf.train.box_rays import BINS, RAYS_PER_STEP
from toonset.nerf.train.train import MOST_SAMPLES

# Peak resident memory over that before, as tests/nerf/run/test_files.py measures it.
CARVED_BYTES = 40  # of a voxel of the hull's grid, while it is carved and faired
VOXEL_BYTES = 12  # and later
SAMPLE_BYTES = 140  # its place; interpolation both ways of the half that is left
FIXED_BYTES = 60 * 2**20  # activations of a batch, parameters, allocator
PIXEL_BYTES = 100  # of a whole ray through the box, while rays are laid out
BOX_SAMPLE_BYTES = 650  # of a step along whole rays: points, features, hidden values, gradients
GIGABYTE = 1e9
OUT_OF_MEMORY = ("can't allocate memory", "out of memory", "not enough memory")
CGROUP = Path("/sys/fs/cgroup")


def check_memory(scene: Scene, options: TrainOptions, device: torch.device) -> str:
    """Return how much memory a training needs and how much is free, in words.

    Raises:
        BundleError: it needs more than is free.
    """
    need = needed_bytes(scene, options)
    free = [free_bytes()]
    if device.type == "cuda":
        free.append(torch.cuda.mem_get_info(device)[0])
    known = [amount for amount in free if amount is not None]
    text = f"{need / GIGABYTE:.1f} GB"
    if not known:
        return f"memory: about {text} more"
    there = f"{min(known) / GIGABYTE:.1f} GB"
    if need > min(known):
        raise BundleError(
            f"{scene.name}: training needs about {text} of memory, {there} are free; end other "
            "programs, or use smaller or fewer pictures"
        )
    return f"memory: about {text} more, {there} are free"


def needed_bytes(scene: Scene, options: TrainOptions) -> int:
    """Return about how many bytes training takes beside those that are in use already."""
    if not options.carve:
        pixels = sum(frame.rgba.shape[0] * frame.rgba.shape[1] for frame in scene.frames)
        samples = min(pixels, RAYS_PER_STEP) * BINS
        return int(FIXED_BYTES + PIXEL_BYTES * pixels + BOX_SAMPLE_BYTES * samples)
    voxels = per_px(scene, VOXELS_PER_PX, VOXELS) ** 3 * _slenderness(scene)
    samples = min(MOST_RAYS, _rays(scene)) * MOST_SAMPLES
    steps = VOXEL_BYTES * voxels + SAMPLE_BYTES * samples
    return int(FIXED_BYTES + max(CARVED_BYTES * voxels, steps))


def free_bytes() -> int | None:
    """Return how many bytes a process may still take, None where the system does not say.

    The least of what the machine has, what the process may address, and what its control groups
    (containers, batch systems) leave.
    """
    amounts = [_machine_free(), _address_space_free(), *_cgroups_free()]
    known = [amount for amount in amounts if amount is not None]
    return max(0, min(known)) if known else None


@contextlib.contextmanager
def memory_errors() -> Iterator[None]:
    """Turn torch's ways to say that memory ran out into a `MemoryError` of one line."""
    try:
        yield
    except RuntimeError as error:
        message = str(error)
        if not isinstance(error, torch.OutOfMemoryError) and not any(
            words in message for words in OUT_OF_MEMORY
        ):
            raise
        where = "the GPU" if isinstance(error, torch.OutOfMemoryError) else "this machine"
        raise MemoryError(f"training asked for more than {where} has") from error


def _rays(scene: Scene) -> int:
    """Return how many pixels lie on or just beside the figures."""
    total = 0
    for frame in scene.frames:
        covered = torch.as_tensor(frame.rgba[..., 3] > 0)[None].float()
        total += int(F.max_pool2d(covered, 3, stride=1, padding=1).sum())
    return total


def _slenderness(scene: Scene) -> float:
    """Return about how much of a cube around the figure its box takes."""
    shares = []
    for frame in scene.frames:
        mask = frame.rgba[..., 3] > 0
        height, width = int(mask.any(axis=1).sum()), int(mask.any(axis=0).sum())
        if height and width:
            shares.append(min(height, width) / max(height, width))
    return float(np.max(shares, initial=0.0)) ** 2


def _machine_free() -> int | None:
    with contextlib.suppress(OSError, ValueError, IndexError):
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    return None


def _address_space_free() -> int | None:
    with contextlib.suppress(ImportError, OSError, ValueError, IndexError):
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        if limit != resource.RLIM_INFINITY:
            pages = int(Path("/proc/self/statm").read_text().split()[0])
            return limit - pages * resource.getpagesize()
    return None


def _cgroups_free() -> list[int]:
    """Return what the process's control group and those around it leave (Linux, version 2)."""
    found: list[int] = []
    with contextlib.suppress(OSError, ValueError):
        own = Path("/proc/self/cgroup").read_text().splitlines()
        name = next((line[3:] for line in own if line.startswith("0::")), "/")
        place = PurePosixPath(name.strip())
        for group in (place, *place.parents):
            found += _cgroup_free(CGROUP / str(group).lstrip("/"))
    return found


def _cgroup_free(folder: Path) -> list[int]:
    with contextlib.suppress(OSError, ValueError, IndexError):
        limit = (folder / "memory.max").read_text().strip()
        if limit != "max":
            used = int((folder / "memory.current").read_text())
            stat = (folder / "memory.stat").read_text().splitlines()
            cache = sum(int(line.split()[1]) for line in stat if line.startswith("inactive_file "))
            return [int(limit) - used + cache]
    return []
