"""Marks of tests that need rendering, and the reason why they are skipped without it."""

import pytest

from pilotfish.environments.scene_renderer import rendering_error

needs_renderer = pytest.mark.skipif(bool(rendering_error()), reason=rendering_error())
