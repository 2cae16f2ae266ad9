"""Finished work on disk: one file a key, whole or absent."""

import hashlib
import logging
import os
import pickle
import threading
from pathlib import Path

from scanweld.errors import WriteError

logger = logging.getLogger(__name__)

_PROTOCOL = 5
"""Brings frozen arrays back read-only; a kernel would be compiled anew for writable ones."""
_DIGEST_SIZE = hashlib.sha256().digest_size
_STALE = (pickle.UnpicklingError, AttributeError, ImportError, TypeError)


class FileCache:
    """Keeps values under hex keys in a folder that may vanish, be cut short or come from elsewhere.

    Each file starts with the hash of the rest: what was cut short counts as absent.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def get(self, key: str) -> object | None:
        """What was kept under the key, or None."""
        path = self._path(key)
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            return None
        digest, body = data[:_DIGEST_SIZE], data[_DIGEST_SIZE:]
        if hashlib.sha256(body).digest() != digest:
            logger.debug("%s is damaged and is made anew", path)
            return None
        try:
            return pickle.loads(body)
        except _STALE as error:
            logger.debug("%s is of another version (%s) and is made anew", path, error)
            return None

    def put(self, key: str, value: object) -> None:
        """Keep a value under the key; after this it survives an interruption.

        Raises:
            WriteError: If it cannot be written.
        """
        body = pickle.dumps(value, protocol=_PROTOCOL)
        path = self._path(key)
        partial = path.with_suffix(f".{os.getpid()}-{threading.get_ident()}")
        try:
            partial.write_bytes(hashlib.sha256(body).digest() + body)
            partial.replace(path)
        except OSError as error:
            raise WriteError(
                f"{self._folder}: cannot keep finished work ({error.strerror}); make room there"
            ) from error

    def is_empty(self) -> bool:
        """Whether nothing is kept."""
        return next(self._folder.glob("*.pkl"), None) is None

    def _path(self, key: str) -> Path:
        if not (key.isascii() and key.isalnum()):
            raise ValueError(f"a key is a hex string, not {key!r}")
        return self._folder / f"{key}.pkl"
