"""What several tests of nerf look at: a trained field and the drawn look of an egg."""

from __future__ import annotations

import pytest

from tests.nerf.ellipsoids import QUICK, train_scene
from tests.nerf.look.painted import drawings
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.train.fit_field import fit_field
from toonset.nerf.train.labelling import label_scene
from toonset.nerf.train.result import Training


@pytest.fixture(scope="session")
def training() -> Training:
    """Return the field of the ellipsoids; nobody may change it."""
    return fit_field(label_scene(train_scene())[0], QUICK)


@pytest.fixture(scope="session")
def egg() -> Drawings:
    """Return the egg's drawings; nobody may change them."""
    return drawings()
