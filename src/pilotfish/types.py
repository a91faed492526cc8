"""Array types that state their shape; the tests check every one.

jaxtyping takes half as long to import as NumPy, and its annotations do nothing unless a checker reads them.
So they are used where a checker asks for them: a static one, or one that has imported jaxtyping by the time
that pilotfish is imported, as the tests do. Elsewhere Float[Array, "T D"] is Array.
"""

import sys
from typing import TYPE_CHECKING

import numpy as np

Array = np.ndarray

if TYPE_CHECKING or "jaxtyping" in sys.modules:
    from jaxtyping import Bool, Float, Int, UInt8
else:

    class Float:
        """An array of a data type and a shape, neither of which is checked."""

        def __class_getitem__(cls, parameters):
            """Return the type of the array, the first of the two parameters."""
            return parameters[0]

    Bool = Int = UInt8 = Float

__all__ = ["Array", "Bool", "Float", "Int", "UInt8"]
