"""Interpolate bilinearly by a sparse matrix.

The features of all planes lie in one table; a sample reads 12 of its rows (4 corners of 3 planes):

    features = W table,      d loss / d table = W^T (d loss / d features)

Where rays and samples do not move while a field is fitted, neither does W: both products are one
`embedding_bag` call, the second with the transposed matrix laid out once. Where every step has
samples of its own, its W is used once: laying out the transpose would take longer than the product.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Float, Int
from torch import Tensor


@dataclass(frozen=True, eq=False)
class Operator:
    """A sparse matrix W of `samples` rows, and its transpose.

    Attributes:
        rows: (samples, taps) table row of every tap.
        weights: (samples, taps) weight of every tap.
        samples_by_row: (samples * taps,) sample of every tap, sorted by table row.
        weights_by_row: (samples * taps,) the weights in that order.
        offsets: (table rows + 1,) where each table row's taps begin.
    """

    rows: Int[Tensor, "samples taps"]
    weights: Float[Tensor, "samples taps"]
    samples_by_row: Int[Tensor, " entries"]
    weights_by_row: Float[Tensor, " entries"]
    offsets: Int[Tensor, " ends"]

    @classmethod
    def of(
        cls,
        rows: Int[Tensor, "samples taps"],
        weights: Float[Tensor, "samples taps"],
        table_rows: int,
    ) -> Operator:
        """Return the operator with its transpose laid out."""
        flat = rows.reshape(-1)
        order = flat.argsort(stable=True)
        counts = torch.bincount(flat, minlength=table_rows)
        offsets = torch.cat([counts.new_zeros(1), counts.cumsum(0)])
        samples = torch.div(order, rows.shape[1], rounding_mode="floor")
        return cls(rows.int(), weights, samples.int(), weights.reshape(-1)[order], offsets.int())

    def to(self, device: torch.device) -> Operator:
        """Return the operator on a device."""
        return Operator(*(getattr(self, field.name).to(device) for field in fields(self)))

    def __call__(
        self, table: Float[Tensor, "entries channels"]
    ) -> Float[Tensor, "samples channels"]:
        """Return W table, differentiable in the table."""
        return _Apply.apply(table, self)


class _Apply(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, table: Tensor, operator: Operator) -> Tensor:
        ctx.operator = operator
        table = table.detach()  # else a gradient is prepared for that is never asked
        return F.embedding_bag(
            operator.rows, table, per_sample_weights=operator.weights, mode="sum"
        )

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        operator: Operator = ctx.operator
        gradient = F.embedding_bag(
            operator.samples_by_row,
            gradients[0].contiguous(),
            operator.offsets,
            per_sample_weights=operator.weights_by_row,
            mode="sum",
            include_last_offset=True,
        )
        return gradient, None


def apply_once(
    table: Float[Tensor, "entries channels"],
    rows: Int[Tensor, "samples taps"],
    weights: Float[Tensor, "samples taps"],
) -> Float[Tensor, "samples channels"]:
    """Return W table for a W that no other step has, differentiable in the table."""
    if table.device.type == "cpu":
        return _ApplyOnce.apply(table, rows, weights)
    return F.embedding_bag(rows, table, per_sample_weights=weights, mode="sum")


class _ApplyOnce(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, table: Tensor, rows: Tensor, weights: Tensor) -> Tensor:
        ctx.save_for_backward(rows, weights)
        ctx.entries = len(table)
        return F.embedding_bag(rows, table.detach(), per_sample_weights=weights, mode="sum")

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None, None]:
        from scipy import sparse  # here: most trainings do without

        rows, weights = ctx.saved_tensors
        samples, taps = rows.shape
        ends = np.arange(0, samples * taps + 1, taps, dtype=np.int32)
        parts = (weights.view(-1).numpy(), rows.view(-1).numpy(), ends)
        transposed = sparse.csc_array(parts, shape=(ctx.entries, samples))  # W's rows, as columns
        return torch.from_numpy(transposed @ gradients[0].contiguous().numpy()), None, None
