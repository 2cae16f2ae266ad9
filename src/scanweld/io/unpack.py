"""Unpacking files with a bound: a few bytes can stand for any number of them."""

import gzip
import zlib
from io import BytesIO
from pathlib import Path
from typing import Protocol

from scanweld.errors import ReadError

GZIP = b"\x1f\x8b"
"""How a .gz begins."""
SMALL = 64 * 2**20
"""Bytes up to which anything may unpack,"""
MOST_EXPANSION = 100
"""and how many times larger than it is a larger file may become: coordinates pack 2 to 20 times."""


class _Stream(Protocol):
    def read(self, size: int, /) -> bytes: ...


def gunzip(path: Path, data: bytes) -> bytes:
    """What a .gz holds.

    Raises:
        ReadError: If it is broken, or far larger than measured points can be.
    """
    if not data.startswith(GZIP):
        raise ReadError(f"{path}: is not packed; take .gz off its name")
    try:
        with gzip.GzipFile(fileobj=BytesIO(data)) as stream:
            return read_bounded(path, stream, len(data))
    except (OSError, EOFError, zlib.error) as error:
        raise ReadError(f"{path}: cannot be unpacked ({error}); copy it again") from error


def read_bounded(path: Path, stream: _Stream, packed: int) -> bytes:
    """All that a stream of so many packed bytes holds.

    Raises:
        ReadError: If it is far larger than measured points can be.
    """
    limit = max(SMALL, MOST_EXPANSION * packed)
    found = stream.read(limit + 1)
    if len(found) > limit:
        raise ReadError(
            f"{path}: unpacks to more than {limit // 2**20} MB, which no scan does; leave it out"
        )
    return found
