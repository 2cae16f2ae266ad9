"""Finished work on disk: one file a key, whole or absent."""

import hashlib
import logging
import os
import threading
from pathlib import Path

from scanweld.errors import WriteError
from scanweld.heat.features import Features
from scanweld.pairs.result import PairResult
from scanweld.work.records import RecordError, Records

logger = logging.getLogger(__name__)

KEPT = Records(Features, PairResult)
"""What a run keeps: all that it computes for each scan, and for each pair of scans."""
_SUFFIX = ".record"
_DIGEST_SIZE = hashlib.sha256().digest_size


class FileCache:
    """Keeps records in a folder that may vanish, be cut short or come from elsewhere.

    Each file starts with the hash of the rest: what was cut short counts as absent. So does what
    cannot be read exactly. Files hold data alone, so that a folder from elsewhere can run no code.

    Args:
        folder: Where the files are.
        records: Writes and reads what is kept.
    """

    def __init__(self, folder: Path, records: Records = KEPT) -> None:
        self._folder = folder
        self._records = records

    def get(self, key: str) -> object | None:
        """What was kept under the key, or None."""
        path = self._path(key)
        try:
            data = path.read_bytes()
        except OSError:
            return None
        digest, body = data[:_DIGEST_SIZE], data[_DIGEST_SIZE:]
        if hashlib.sha256(body).digest() != digest:
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
            partial.write_bytes(hashlib.sha256(body).digest() + body)
            os.replace(partial, path)
        except OSError as error:
            raise WriteError(
                f"{self._folder}: cannot keep finished work ({error.strerror}); make room there"
            ) from error

    def is_empty(self) -> bool:
        """Whether nothing is kept."""
        return next(self._folder.glob(f"*{_SUFFIX}"), None) is None

    def _path(self, key: str) -> Path:
        if not (key.isascii() and key.isalnum()):
            raise ValueError(f"a key is a hex string, not {key!r}")
        return self._folder / f"{key}{_SUFFIX}"
