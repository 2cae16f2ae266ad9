"""Array types of the records, and the one way to freeze an array into a record."""

from typing import TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
IndexArray = NDArray[np.signedinteger]
"""Whole numbers of any size: those of a scan's grid take half as much memory."""
BoolArray = NDArray[np.bool_]
ByteArray = NDArray[np.uint8]

LARGEST_EXACT = 2**53
"""Above this a double does not hold all whole numbers, nor a digit behind the point."""


def frozen(values: ArrayLike, dtype: type[np.generic], shape: tuple[int | None, ...]) -> NDArray:
    """A read-only, C-ordered array of the given type; ``None`` in the shape stands for any length.

    A copy, unless the array is frozen already: records share what they hand on.

    Raises:
        ValueError: If the shape does not fit.
    """
    array = values if _is_frozen(values, dtype) else np.array(values, dtype=dtype, order="C")
    if array.shape != shape and not _fits(array.shape, shape):
        raise ValueError(f"expected an array of shape {shape}, got {array.shape}")
    array.flags.writeable = False
    return array


def _fits(has: tuple[int, ...], wanted: tuple[int | None, ...]) -> bool:
    return len(has) == len(wanted) and all(
        want is None or want == have for want, have in zip(wanted, has, strict=True)
    )


def _is_frozen(values: ArrayLike, dtype: type[np.generic]) -> TypeGuard[NDArray]:
    """Whether nobody can write to an array: a read-only view may be of one that is written to."""
    if type(values) is not np.ndarray or values.dtype != dtype:
        return False
    return values.flags.owndata and values.flags.c_contiguous and not values.flags.writeable
