"""One run at a time on one output."""

import contextlib
import os
import time
from pathlib import Path

from filelock import FileLock, Timeout

from scanweld.errors import WriteError


class Lock:
    """A lock file that the system frees when its process ends, however it ends.

    Beside it stands a file for people to read, with the process's id and its start. (On Windows
    nobody else can read the locked file itself.)

    Raises:
        WriteError: If a live process holds the lock.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._holder = path.with_name(f"{path.name}-holder")
        self._lock = FileLock(path, timeout=0)
        try:
            self._lock.acquire()
        except Timeout as error:
            raise WriteError(
                f"{path.parent}: another run is at work on this output ({self._told_holder()}); "
                "wait for it, or choose another output"
            ) from error
        self._holder.write_text(f"process {os.getpid()}, since {time.ctime()}\n", encoding="utf-8")

    @property
    def files(self) -> tuple[Path, Path]:
        """What it keeps in its folder."""
        return self._path, self._holder

    def release(self, *, remove: bool = False) -> None:
        """Let others have it.

        Args:
            remove: Whether its files go as well.
        """
        if not remove:
            self._lock.release()
            return
        self._holder.unlink(missing_ok=True)
        # Removed while it is held, so that it is never another run's; Windows refuses that.
        removed = _unlinked(self._path)
        self._lock.release()
        if not removed:
            _unlinked(self._path)

    def _told_holder(self) -> str:
        with contextlib.suppress(OSError):
            return self._holder.read_text(encoding="utf-8", errors="replace").strip()
        return "its process is not known"


def _unlinked(path: Path) -> bool:
    try:
        path.unlink(missing_ok=True)
    except OSError:
        return False
    return True
