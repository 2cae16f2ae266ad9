"""LZF, the compression of PCD files: literal runs, and copies of what came before."""

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.geometry.arrays import ByteArray
from scanweld.io.unpack import MOST_EXPANSION


def lzf_decompress(data: ByteArray, size: int) -> ByteArray | None:
    """The ``size`` bytes that compressed data stands for; None if it is broken, or stands for more.

    Args:
        data: (N,) compressed, three bytes of which stand for 264 at most.
        size: Of the result.
    """
    if size > MOST_EXPANSION * len(data):
        return None
    out = np.empty(size, dtype=np.uint8)
    return out if _expand(data, out) == size else None


@njit(cache=True, nogil=True)
def _expand(data: ByteArray, out: ByteArray) -> int:  # pragma: no cover - compiled
    """Fill ``out``; its length where all went well, -1 where the data is broken."""
    at, put = 0, 0
    while at < len(data):
        control = int(data[at])
        at += 1
        if control < 32:
            length = control + 1
            if at + length > len(data) or put + length > len(out):
                return -1
            for k in range(length):
                out[put + k] = data[at + k]
            at += length
        else:
            length = control >> 5
            if at + (2 if length == 7 else 1) > len(data):
                return -1
            if length == 7:
                length += int(data[at])
                at += 1
            length += 2
            source = put - ((control & 31) << 8) - int(data[at]) - 1
            at += 1
            if source < 0 or put + length > len(out):
                return -1
            for k in range(length):
                out[put + k] = out[source + k]
        put += length
    return put
