"""The kinds of fields, by name: what a run folder records and what builds the field again."""

from __future__ import annotations

from toonset.dataset.silhouettes.bounds import Box
from toonset.nerf.fields.base import Field, FieldSpec
from toonset.nerf.fields.mlp import MlpField
from toonset.nerf.fields.triplane import TriplaneField
from toonset.nerf.fields.voxel import VoxelField


def build_field(spec: FieldSpec, box: Box) -> Field:
    """Return an untrained field of a kind over a box."""
    if spec.kind == "mlp":
        return MlpField(box, spec.channels, spec.hidden)
    if spec.kind == "voxel":
        return VoxelField(box, spec.resolution)
    return TriplaneField(box, spec.resolution, spec.channels, spec.hidden)
