"""One run at a time on one output."""

import fcntl
import os
import time
from pathlib import Path

from scanweld.errors import WriteError


class Lock:
    """A lock file that the system frees when its process ends, however it ends.

    The file's content, the process's id and its start, is there to be read by people.

    Raises:
        WriteError: If a live process holds the lock.
    """

    def __init__(self, path: Path) -> None:
        self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            holder = os.read(self._file, 200).decode(errors="replace").strip()
            os.close(self._file)
            raise WriteError(
                f"{path.parent}: another run is at work on this output ({holder}); "
                "wait for it, or choose another output"
            ) from error
        os.ftruncate(self._file, 0)
        os.write(self._file, f"process {os.getpid()}, since {time.ctime()}\n".encode())

    def release(self) -> None:
        """Let others have it."""
        os.close(self._file)
