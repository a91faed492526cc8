"""What readers of binary formats raise when a file is damaged; found by damaging files at random."""

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
    NameError,  # inside scipy.io, when a variable has a class it does not know
    SyntaxError,  # with TokenError, from the header of a NumPy array
    RuntimeError,  # an archive that is encrypted, or packed in a way zipfile lacks
    MemoryError,  # a header that promises more numbers than fit
    tokenize.TokenError,
    zlib.error,
    zipfile.BadZipFile,
)
