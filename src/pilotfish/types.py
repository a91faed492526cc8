"""Array types that state their shape; the tests check every annotation.

jaxtyping takes half as long to import as NumPy, and its annotations have no effect unless a checker reads
them. It is therefore imported only for a static checker, or if it was imported before pilotfish, as the tests
do. Otherwise `Float[Array, "T D"]` is a plain subclass of `Array` that keeps the text of its shape.
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
    def _make_array_type(array, shape):
        return type(array.__name__, (array,), {"dim_str": shape.strip()})

    class Float:
        """An array of a data type and a shape, neither of which is checked."""

        def __class_getitem__(cls, parameters):
            """Return a type with the text of the shape in dim_str, which the file codecs read."""
            return _make_array_type(*parameters)

    Bool = Int = UInt8 = Float

__all__ = ["Array", "Bool", "Float", "Int", "UInt8"]
