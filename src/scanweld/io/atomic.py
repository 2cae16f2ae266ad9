"""Writing a file whole or not at all."""

import contextlib
import os
import threading
from pathlib import Path

from scanweld.errors import WriteError


def write_whole(path: Path, data: bytes) -> None:
    """Write a file under a temporary name beside it, then rename: what stood there stays whole.

    Raises:
        WriteError: If the file cannot be written.
    """
    # Not called after the file, whose name may be as long as names can be.
    temporary = path.with_name(f".{os.getpid()}.{threading.get_ident()}.tmp")
    try:
        temporary.write_bytes(data)
        temporary.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise WriteError(
            f"{path}: cannot be written ({error.strerror}); check the folder and its permissions"
        ) from error
