"""Settings of the published experiments, for tests of values that the defaults of the library change."""

from typing import Any

from pilotfish.models import EMSettings, TimeBins

PUBLISHED_SETTINGS = EMSettings(regularisation=1e-5, tolerance=1e-5, duration_regularisation=1.0)


def published_options() -> dict[str, Any]:
    """Return the options of `learn` with which it learns as published."""
    return {"settings": PUBLISHED_SETTINGS, "initialisation": TimeBins()}
