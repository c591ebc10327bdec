"""What several tests of nerf look at: one trained field."""

from __future__ import annotations

import pytest

from tests.nerf.ellipsoids import QUICK, train_scene
from toonset.nerf.train.labelling import label_scene
from toonset.nerf.train.result import Training
from toonset.nerf.train.train import fit_field


@pytest.fixture(scope="session")
def training() -> Training:
    """Return the field of the ellipsoids; nobody may change it."""
    return fit_field(label_scene(train_scene())[0], QUICK)
