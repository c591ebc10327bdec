"""The kinds of fields, by name: what a run folder records and what builds the field again."""

from __future__ import annotations

from toonset.dataset.silhouettes.bounds import Box
from toonset.nerf.field import TriplaneField
from toonset.nerf.field_mlp import MlpField
from toonset.nerf.field_voxel import VoxelField
from toonset.nerf.fields import Field, FieldSpec


def build_field(spec: FieldSpec, box: Box) -> Field:
    """Return an untrained field of a kind over a box."""
    if spec.kind == "mlp":
        return MlpField(box, spec.channels, spec.hidden)
    if spec.kind == "voxel":
        return VoxelField(box, spec.resolution)
    return TriplaneField(box, spec.resolution, spec.channels, spec.hidden)
