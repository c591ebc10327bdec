"""Classify rendered colours into palette labels."""

from __future__ import annotations

import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn

HIDDEN = 128


class PaletteClassifier(nn.Module):
    """One hidden layer of 128, softmax over the palette's labels, on the rendered RGB."""

    def __init__(self, colors: int) -> None:
        """Build the classifier for `colors` labels."""
        super().__init__()
        self.hidden = nn.Linear(3, HIDDEN)
        self.out = nn.Linear(HIDDEN, colors)

    def forward(self, rgb: Float[Tensor, "n 3"]) -> Float[Tensor, "n colors"]:
        """Return the logits of the labels for colours in [0, 1]."""
        return self.out(F.relu(self.hidden(2 * rgb - 1)))
