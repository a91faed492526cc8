"""Protocol of the published valve experiment, which several reproductions share.

The first four demonstrations train, the others test. Source: Tanwani 2018, sections 3.4 and 4.3.1.
"""

import pilotfish as pf
from pilotfish.models import EMSettings
from pilotfish.planning import Reproduction, reproduce_demonstration

STATES = 7
SETTINGS = EMSettings(regularisation=1e-5)
COVARIANCE_REGULARISATION = 2e-3  # m^2, and squared quaternion entries
CONTROL_COST = 9.0


def reproduce_published(
    skill: pf.Skill, demonstration: pf.Demonstration, *, from_first_state: bool = False
) -> Reproduction:
    """Reproduce a skill in the situation of a demonstration, with the published control parameters."""
    return reproduce_demonstration(
        skill,
        demonstration,
        from_first_state=from_first_state,
        control_cost=CONTROL_COST,
        covariance_regularisation=COVARIANCE_REGULARISATION,
    )
