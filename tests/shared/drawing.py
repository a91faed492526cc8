"""Which laws need pictures of the physics, and why they are skipped where nothing draws."""

import pytest

from pilotfish.environments.scene_renderer import rendering_error

needs_renderer = pytest.mark.skipif(bool(rendering_error()), reason=rendering_error())
