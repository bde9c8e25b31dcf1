"""Files of MATLAB before version 7.3, of unknown origin: their variables, or one error that says what is wrong."""

from __future__ import annotations

import struct
import zlib
from io import BytesIO
from pathlib import Path
from typing import Any

from isomatch.errors import FormatError
from isomatch.storage.files import opened

_DAMAGED = (
    OSError, ValueError, TypeError, LookupError, ArithmeticError, AttributeError, MemoryError, RuntimeError,
    zlib.error, struct.error,
)  # fmt: skip
"""What `scipy.io.loadmat` raises for damaged files, besides its own errors."""


def read_mat(path: Path, what: str, expected: str) -> dict[str, Any]:
    """Read the variables of a ``.mat`` file by name: arrays, and structs as objects, both without axes of length 1.

    ``what`` the file should be, and what is ``expected`` in it, is for the message.

    Raises
    ------
    MissingFileError
        If there is no such file.
    FormatError
        If it is no file of MATLAB, or one of version 7.3, which is HDF5.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    with opened(path) as file:
        data = BytesIO(file.read())
    try:
        stored = loadmat(data, squeeze_me=True, struct_as_record=False)
    except (*_DAMAGED, MatReadError) as error:
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise FormatError(
            f"{path}: not {what} ({reason}); expected a MATLAB file before version 7.3 (save -v7) with {expected}"
        ) from error
    return {name: value for name, value in stored.items() if not name.startswith("__")}
