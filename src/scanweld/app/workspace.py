"""The output folder: made aside, moved into place when whole.

For an output ``model`` all work goes to ``.model.work`` beside it: a lock, and the folder that
becomes the output in the end. What is finished on the way is kept elsewhere (``app.cache``).
"""

import contextlib
import logging
import shutil
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from scanweld.app.lock import Lock
from scanweld.errors import WriteError

logger = logging.getLogger(__name__)


class Workspace:
    """Where a run works, as a context.

    Entering refuses an output that cannot be made, before any work. Leaving removes the workspace,
    whether the output was published or not; an old output is then in its place again.

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
        self._old = self.folder / "old"
        self._inputs = [path.resolve() for path in inputs]
        self._force = force
        self._made: list[Path] = []
        self._lock: Lock | None = None

    def __enter__(self) -> Self:
        try:
            self._check_place()
            self._check_free()
            self._open()
            self._check_free()
        except OSError as error:
            self._leave()
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
        self._leave()

    def publish(self) -> None:
        """Move the finished folder to the output's place, and an old one out of it first.

        Raises:
            WriteError: If that fails; then the old output is back in its place.
        """
        try:
            if self._force and self.output.exists():
                self.output.rename(self._old)
            self.staging.rename(self.output)
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

    def _put_back(self) -> None:
        """Bring back an old output that was moved aside and not replaced."""
        if self._old.exists() and not _is_filled(self.output):
            self._old.rename(self.output)

    def _leave(self) -> None:
        """Remove the workspace, and folders made that are empty; no old output without a new."""
        if self._lock is not None:
            self._clear(self.staging)
            if _is_filled(self.output):
                self._clear(self._old)
            self._lock.release(remove=True)
            self._lock = None
        for folder in (self.folder, *reversed(self._made)):
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

    def _unlock(self) -> None:
        if self._lock is not None:
            self._lock.release()
            self._lock = None


def work_folder(output: Path) -> Path:
    """Where the work for an output is done."""
    place = output.resolve()
    return place.parent / f".{place.name}.work"


def _is_filled(folder: Path) -> bool:
    return folder.is_dir() and any(folder.iterdir())
