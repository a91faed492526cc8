"""Array types that state their shape; the tests check every one.

jaxtyping takes half as long to import as NumPy, and its annotations do nothing unless a checker reads them.
So they are used where a checker asks for them: a static one, or one that has imported jaxtyping by the time
that pilotfish is imported, as the tests do. Elsewhere Float[Array, "T D"] is an Array with these letters.
"""

import sys
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

Array = np.ndarray

if TYPE_CHECKING or "jaxtyping" in sys.modules:
    from jaxtyping import Bool, Float, Int, UInt8
else:

    @cache
    def _shaped(array, letters):
        return type(array.__name__, (array,), {"dim_str": letters.strip()})

    class Float:
        """An array of a data type and a shape, neither of which is checked."""

        def __class_getitem__(cls, parameters):
            """Return a type with the letters of the shape in dim_str: the codec of files reads them."""
            return _shaped(*parameters)

    Bool = Int = UInt8 = Float

__all__ = ["Array", "Bool", "Float", "Int", "UInt8"]
