"""Protocol of the published valve experiment: Tanwani 2018, sections 3.4 and 4.3.1."""

from pilotfish.models import EMSettings

STATES = 7
TRAINING_DEMONSTRATIONS = 4  # the first ones; the others are test situations
SETTINGS = EMSettings(regularisation=1e-5, tolerance=1e-5, duration_regularisation=1.0)
COVARIANCE_REGULARISATION = 2e-3  # m^2, and squared quaternion entries
CONTROL_COST = 9.0
