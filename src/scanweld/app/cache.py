"""Finished work on disk: one file a key, whole or absent, and not more of them than a bound."""

import contextlib
import hashlib
import logging
import os
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from scanweld.errors import WriteError
from scanweld.fusion.posed_image import PosedImage
from scanweld.heat.features import Features
from scanweld.pairs.result import PairResult
from scanweld.pipeline.preparations import Preparation
from scanweld.work.records import RecordError, Records

logger = logging.getLogger(__name__)

KEPT = Records(Preparation, Features, PairResult, PosedImage)
"""What a run keeps: all that it computes for each scan, and for each pair of scans."""
NAME = ".scanweld-cache"
"""Of the folder beside an output. Runs on several outputs in one place share it."""
MAX_BYTES = 2 * 10**9
_ROOM = 0.9
"""Share of the bound that is left when records have to go, so that this is not done each time."""
_SUFFIX = ".record"
_DIGEST_SIZE = hashlib.sha256().digest_size


@dataclass(frozen=True, kw_only=True, slots=True)
class CacheSize:
    """How many records are kept, and how many bytes they are."""

    records: int
    bytes: int


class FileCache:
    """Keeps records in a folder that may vanish, be cut short or come from elsewhere at any time.

    Each file starts with the hash of the rest: what was cut short counts as absent. So does what
    cannot be read exactly. Files hold data alone, so that a folder from elsewhere can run no code.
    The folder is made when there is something to keep. Several runs may share it.

    Args:
        folder: Where the files are.
        records: Writes and reads what is kept.
        max_bytes: Where there are more, those go first that were not used for longest.
    """

    def __init__(self, folder: Path, records: Records = KEPT, max_bytes: int = MAX_BYTES) -> None:
        self._folder = folder
        self._records = records
        self._max_bytes = max_bytes
        self._bytes: int | None = None
        self._lock = threading.Lock()

    def get(self, key: str) -> object | None:
        """What was kept under the key, or None."""
        path = self._path(key)
        try:
            data = path.read_bytes()
            os.utime(path)
        except OSError:
            return None
        body = memoryview(data)[_DIGEST_SIZE:]
        if hashlib.sha256(body).digest() != data[:_DIGEST_SIZE]:
            logger.debug("%s is damaged and is made anew", path)
            return None
        try:
            return self._records.from_bytes(body)
        except RecordError as error:
            logger.debug("%s cannot be used (%s) and is made anew", path, error)
            return None

    def put(self, key: str, value: object) -> None:
        """Keep a value under the key; after this it survives an interruption.

        Raises:
            WriteError: If it cannot be written.
        """
        body = self._records.to_bytes(value)
        path = self._path(key)
        partial = path.with_suffix(f".{os.getpid()}-{threading.get_ident()}")
        try:
            self._write(partial, body)
            os.replace(partial, path)
        except OSError as error:
            raise WriteError(
                f"{self._folder}: cannot keep finished work ({error.strerror}); "
                "make room there, or do without it (--no-cache)"
            ) from error
        self._make_room(_DIGEST_SIZE + len(body))

    def size(self) -> CacheSize:
        """What is kept by now."""
        sizes = [size for _, size, _ in self._files()]
        return CacheSize(records=len(sizes), bytes=sum(sizes))

    def clear(self) -> CacheSize:
        """Remove all that is kept, and tell how much it was."""
        before = self.size()
        for _, _, path in self._files():
            with contextlib.suppress(OSError):
                path.unlink()
        with contextlib.suppress(OSError):
            self._folder.rmdir()
        return before

    def _write(self, path: Path, body: bytes) -> None:
        data = hashlib.sha256(body).digest() + body
        try:
            path.write_bytes(data)
        except FileNotFoundError:  # not made yet, or removed while we run
            self._folder.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)

    def _make_room(self, added: int) -> None:
        with self._lock:
            if self._bytes is None:
                self._bytes = self.size().bytes
            else:
                self._bytes += added
            if self._bytes <= self._max_bytes:
                return
            files = sorted(self._files())
            left = sum(size for _, size, _ in files)
            for _, size, path in files:
                if left <= _ROOM * self._max_bytes:
                    break
                with contextlib.suppress(OSError):
                    path.unlink()
                    left -= size
            self._bytes = left

    def _files(self) -> Iterator[tuple[int, int, Path]]:
        """When each file was last used, its size, and where it is; those half written too."""
        with contextlib.suppress(OSError):
            for path in self._folder.iterdir():
                with contextlib.suppress(OSError):
                    told = path.stat()
                    yield told.st_mtime_ns, told.st_size, path

    def _path(self, key: str) -> Path:
        if not (key.isascii() and key.isalnum()):
            raise ValueError(f"a key is a hex string, not {key!r}")
        return self._folder / f"{key}{_SUFFIX}"


def cache_folder(output: Path) -> Path:
    """Where finished work of runs on an output is kept."""
    return output.resolve().parent / NAME
