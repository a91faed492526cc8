"""Fixture: random demonstrations."""

import numpy as np
import pytest
from random_demonstrations import DemonstrationMaker


@pytest.fixture
def make(rng: np.random.Generator) -> DemonstrationMaker:
    return DemonstrationMaker(rng)
