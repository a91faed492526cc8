"""Valid arguments of the functions of virtual links, for the fuzzer."""

import numpy as np

from fuzzing.examples_of_values import Examples
from pilotfish.teleop import LinkSettings


def link_examples() -> Examples:
    """Return arguments by function name."""
    return {
        "two_way_link": {
            "forward": LinkSettings(delay=0.5, loss=0.3, mean_burst=4.0, rate=256e3),
            "backward": LinkSettings(delay=0.5, jitter=0.05, outages=((1.0, 2.0),)),
            "rng": np.random.default_rng(0),
        }
    }
