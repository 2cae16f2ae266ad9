"""The output folder: made aside, moved into place when whole.

For an output ``model`` all work goes to ``.model.work`` beside it: a lock, the cache of what was
finished (a rerun continues from there), and the folder that becomes the output in the end.
"""

import contextlib
import logging
import shutil
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from scanweld.app.cache import FileCache
from scanweld.app.lock import Lock
from scanweld.errors import ScanweldError, WriteError

logger = logging.getLogger(__name__)


class Workspace:
    """Where a run works, as a context.

    Entering refuses an output that cannot be made, before any work. Leaving after ``publish``
    removes the workspace; leaving by an error of the user's removes it if this run made it;
    leaving by an interruption or a crash keeps what the cache holds.

    Args:
        output: The folder to be made.
        inputs: Files that the run reads; an output that holds one of them is refused.
        force: Whether an output that is there already is replaced.

    Raises:
        WriteError: On entering or publishing, if the output cannot be made.
    """

    def __init__(self, output: Path, *, inputs: Sequence[Path] = (), force: bool = False) -> None:
        self.output = output.resolve()
        self.folder = work_folder(output)
        self.staging = self.folder / "output"
        self.cache = FileCache(self.folder / "cache")
        self._old = self.folder / "old"
        self._inputs = [path.resolve() for path in inputs]
        self._force = force
        self._published = False
        self._made: list[Path] = []
        self._lock: Lock | None = None

    def __enter__(self) -> Self:
        try:
            self._check_place()
            self._check_free()
            self._open()
            self._check_free()
        except OSError as error:
            self._leave(keep=not self._is_new())
            raise WriteError(
                f"{self.output}: cannot be written ({error.strerror}); choose another output"
            ) from error
        except WriteError:
            self._unlock()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._put_back()
        # An output that could not be written is worth another try; bad input is not.
        is_refused = isinstance(error, ScanweldError) and not isinstance(error, WriteError)
        is_spent = self._published or (is_refused and self._is_new())
        self._leave(keep=not (is_spent or self.cache.is_empty()))

    def publish(self) -> None:
        """Move the finished folder to the output's place, and an old one out of it first.

        Raises:
            WriteError: If that fails; then the old output is back in its place.
        """
        try:
            if self._force and self.output.exists():
                self.output.rename(self._old)
            self.staging.rename(self.output)
            self._published = True
        except OSError as error:
            raise WriteError(
                f"{self.output}: the finished output cannot be moved there ({error.strerror}); "
                "put that right and run again"
            ) from error
        finally:
            self._put_back()

    def _check_place(self) -> None:
        """Refuse places where no folder can be made, or where it would bury something."""
        for path in (self.output, *self.output.parents):
            if path.exists() and not path.is_dir():
                raise WriteError(f"{path}: is not a folder; choose another output")
        here = Path.cwd()
        if self.output in (here, *here.parents) or self.output.is_mount():
            raise WriteError(f"{self.output}: cannot be replaced as a whole; name a folder inside")
        for path in self._inputs:
            if self.output in path.parents:
                raise WriteError(
                    f"{self.output}: holds the input {path.name}; choose another output"
                )

    def _check_free(self) -> None:
        if not self._force and _is_filled(self.output):
            raise WriteError(f"{self.output}: is not empty; choose another output or give --force")

    def _open(self) -> None:
        for folder in (*reversed(self.folder.parents), self.folder):
            if not folder.is_dir():
                folder.mkdir()
                self._made.append(folder)
        self._lock = Lock(self.folder / "lock")
        self._put_back()
        for leftover in (self._old, self.staging):
            self._clear(leftover)
        self.staging.mkdir()
        (self.folder / "cache").mkdir(exist_ok=True)

    def _put_back(self) -> None:
        """Bring back an old output that was moved aside and not replaced."""
        if self._old.exists() and not _is_filled(self.output):
            self._old.rename(self.output)

    def _is_new(self) -> bool:
        return self.folder in self._made

    def _leave(self, *, keep: bool) -> None:
        """Remove the workspace or what is half done in it, and folders made that are empty."""
        if self._lock is not None:
            for part in [self.staging] if keep else self._parts():
                self._clear(part)
        self._unlock(remove=not keep)
        for folder in (*(() if keep else (self.folder,)), *reversed(self._made)):
            # Another run may have begun in it by now: then it is not empty, and its own.
            with contextlib.suppress(OSError):
                folder.rmdir()

    def _clear(self, folder: Path) -> None:
        try:
            if folder.is_dir():
                shutil.rmtree(folder)
            else:
                folder.unlink(missing_ok=True)
        except OSError as error:
            logger.warning("%s: cannot be removed (%s); remove it by hand", folder, error.strerror)

    def _parts(self) -> list[Path]:
        """What the workspace holds, but for the lock: that goes last of all."""
        held = () if self._lock is None else self._lock.files
        return [part for part in self.folder.iterdir() if part not in held]

    def _unlock(self, *, remove: bool = False) -> None:
        if self._lock is not None:
            self._lock.release(remove=remove)
            self._lock = None


def work_folder(output: Path) -> Path:
    """Where the work for an output is done."""
    place = output.resolve()
    return place.parent / f".{place.name}.work"


def _is_filled(folder: Path) -> bool:
    return folder.is_dir() and any(folder.iterdir())
