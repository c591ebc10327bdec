"""Differentiable cameras: bring a camera that was moved back to where landmarks are seen.

python examples/04_refine_a_camera.py [FOLDER]    (default: ./out)

Needs 01_sheet_to_cameras.py first. `ts.project` is batched and differentiable in the points and in
every number of the cameras, on the CPU and on a GPU, for orthographic and pinhole cameras alike.
"""

import sys
from dataclasses import replace
from pathlib import Path

import torch

import toonset as ts
from toonset.projection import CameraTensors, rotate

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
bundle = ts.read_bundle(out / "bundle")
cameras = CameraTensors.of([frame.camera for frame in bundle.scene.frames])
assert bundle.mannequin is not None
points = torch.from_numpy(bundle.mannequin.vertices[::50])[None]
seen = ts.project(cameras, points)  # (views, points, 2) pixels

turn = torch.full((len(cameras.k), 3), 0.2, dtype=torch.float64, requires_grad=True)  # radians
optimiser = torch.optim.LBFGS([turn], line_search_fn="strong_wolfe")


def error() -> torch.Tensor:
    moved = replace(cameras, rotation=rotate(cameras.rotation, turn))
    return (ts.project(moved, points) - seen).square().sum(dim=-1).mean()


def step() -> float:
    optimiser.zero_grad()
    loss = error()
    loss.backward()
    return loss.item()


for _ in range(4):
    print(f"{error().sqrt().item():8.4f} px off")
    optimiser.step(step)
print(f"after: {torch.rad2deg(turn.detach().norm(dim=1)).max().item():.4f} degrees off at most")
