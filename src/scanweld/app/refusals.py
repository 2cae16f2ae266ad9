"""What an export leaves out, and why."""

from collections.abc import Sequence

from scanweld.errors import ScanweldError


class Refusals:
    """What cannot be written, with the reasons."""

    def __init__(self) -> None:
        self.first: ScanweldError | None = None
        self._without: dict[str, list[str]] = {}
        self._whole: dict[str, list[str]] = {}

    def add(self, what: str, error: ScanweldError) -> None:
        """Leave something out of a file or a format."""
        self.first = self.first or error
        self._without.setdefault(" ".join(str(error).split()), []).append(what)

    def add_whole(self, what: str, errors: Sequence[ScanweldError]) -> None:
        """Leave out a file or a format without any scan: the first reason stands for all."""
        self.first = self.first or errors[0]
        more = f" ({len(errors) - 1} more scans likewise)" if len(errors) > 1 else ""
        self._whole.setdefault(" ".join(str(errors[0]).split()) + more, []).append(what)

    def lines(self) -> tuple[str, ...]:
        """One for each reason."""
        return tuple(
            f"{verb} {', '.join(dict.fromkeys(what))}: {told}"
            for verb, group in (("left out", self._whole), ("left out of", self._without))
            for told, what in group.items()
        )
