"""Which laws need pictures of the physics, and why they are skipped where nothing draws."""

import pytest

from pilotfish.environments.cameras import why_nothing_draws

needs_renderer = pytest.mark.skipif(bool(why_nothing_draws()), reason=why_nothing_draws())
