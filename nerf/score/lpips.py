"""Compute LPIPS with its own package, from weights on the user's disk; nothing is downloaded.

The package ships its small linear layers only. The AlexNet below them is read from torch's cache of
weights if its hash is the one that its name says, and only tensors are read: no code in it is run.

Source: Zhang, Isola, Efros, Shechtman, Wang, "The unreasonable effectiveness of deep features as a
perceptual metric", 2018.
"""

from __future__ import annotations

import hashlib
import importlib
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch

WEIGHTS, SHA256_BEGINS = "alexnet-owt-7be5be79.pth", "7be5be79"
SMALLEST_SIDE = 32  # of a picture: below, AlexNet's poolings leave nothing

Lpips = Callable[[np.ndarray, np.ndarray], float | None]


def load_lpips() -> Lpips | str:
    """Return the distance function of two sRGB pictures over white, or why it is missing.

    The pictures are (height, width, 3) in [0, 1]; for those smaller than 32 px it is None.
    """
    weights = Path(torch.hub.get_dir()) / "checkpoints" / WEIGHTS
    try:
        package = importlib.import_module("lpips")
    except ImportError:
        return "the package lpips is not installed"
    if not weights.is_file():
        return f"{weights} does not exist; weights are never downloaded"
    if not _sha256(weights).startswith(SHA256_BEGINS):
        return f"{weights} is damaged: its SHA-256 does not begin with {SHA256_BEGINS}"
    network = _network(package, weights)

    @torch.no_grad()
    def distance(a: np.ndarray, b: np.ndarray) -> float | None:
        if min(a.shape[:2]) < SMALLEST_SIDE:
            return None
        return float(network(_batch(a), _batch(b), normalize=True))

    return distance


def _network(package: Any, weights: Path) -> Any:
    """Return the metric with its trunk filled from the file."""
    with warnings.catch_warnings():  # torchvision's about the package's old way to ask
        warnings.simplefilter("ignore")
        network = package.LPIPS(net="alex", pnet_rand=True, verbose=False)
    state = torch.load(weights, map_location="cpu", weights_only=True)
    for slice_name, layers in network.net.named_children():
        if not slice_name.startswith("slice"):
            continue
        for number, layer in layers.named_children():
            own = {name: state[f"features.{number}.{name}"] for name in layer.state_dict()}
            layer.load_state_dict(own)
    return network.eval()


def _batch(picture: np.ndarray) -> torch.Tensor:
    return torch.as_tensor(picture, dtype=torch.float32).permute(2, 0, 1)[None]


def _sha256(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
