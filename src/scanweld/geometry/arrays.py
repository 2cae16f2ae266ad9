"""Array types of the records, and the one way to freeze an array into a record."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
ByteArray = NDArray[np.uint8]


def frozen(values: ArrayLike, dtype: type[np.generic], shape: tuple[int | None, ...]) -> NDArray:
    """A read-only, C-ordered array of the given type; ``None`` in the shape stands for any length.

    Raises:
        ValueError: If the shape does not fit.
    """
    array = np.array(values, dtype=dtype, order="C", copy=True)
    fits = array.ndim == len(shape) and all(
        want is None or want == have for want, have in zip(shape, array.shape, strict=True)
    )
    if not fits:
        raise ValueError(f"expected an array of shape {shape}, got {array.shape}")
    array.flags.writeable = False
    return array
