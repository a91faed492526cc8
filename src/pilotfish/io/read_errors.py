"""Exceptions that readers of binary formats raise for damaged files, as found by fuzzing."""

import tokenize
import zipfile
import zlib

READ_ERRORS = (
    OSError,
    ValueError,
    EOFError,
    TypeError,
    LookupError,
    ArithmeticError,
    AttributeError,
    NameError,  # of scipy.io, for a variable of an unknown class
    SyntaxError,  # as TokenError, of the header of a NumPy array
    RuntimeError,  # of an archive that is encrypted, or compressed in a way that zipfile lacks
    MemoryError,  # of a header that states more numbers than memory holds
    tokenize.TokenError,
    zlib.error,
    zipfile.BadZipFile,
)
