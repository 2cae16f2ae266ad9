"""How a run tells what it is doing, and where it keeps what it has done."""

from typing import Protocol


class Progress(Protocol):
    """Called as work goes on; the library itself never prints."""

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Say that so many of a stage's items are done."""
        ...


class Cache(Protocol):
    """Keeps finished work under a key made of its input's content and its settings."""

    def get(self, key: str) -> object | None:
        """What was kept under the key, or None."""
        ...

    def put(self, key: str, value: object) -> None:
        """Keep a value under the key; after this it survives an interruption."""
        ...


def silent(stage: str, done: int, total: int) -> None:
    """Progress that nobody looks at."""


class NoCache:
    """Keeps nothing."""

    def get(self, key: str) -> object | None:
        """Nothing was kept."""
        return None

    def put(self, key: str, value: object) -> None:
        """Forget the value."""
