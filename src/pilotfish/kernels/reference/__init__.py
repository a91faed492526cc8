"""NumPy references of all kernels, written like their derivations.

They define the compiled kernels, test them, and replace them where the installation found no compiler.
"""

from pilotfish.kernels.reference.validated import *  # noqa: F403 (every kernel)
