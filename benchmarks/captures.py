"""What measuring commands have in common: options, kept records, frames of data."""

import argparse
from collections.abc import Collection, Sequence
from pathlib import Path

from benchmarks.results import Json, read_results
from scanweld.io.depth.capture import DepthImages, DepthOptions, Frame


def parser_of(what: str, word: str, parts: Collection[str]) -> argparse.ArgumentParser:
    """The options of a command that measures parts, each of which a word says the like of."""
    parser = argparse.ArgumentParser(description=what)
    add = parser.add_argument
    add(f"--{word}s", nargs="+", choices=list(parts), default=list(parts))
    add("--quick", action="store_true", help="something small that needs no data")
    add("--data", type=Path, help="folder of the data")
    add("--workers", type=int, default=2)
    add("--out", type=Path, help="JSON file of all records")
    return parser


def kept_records(path: Path | None, word: str, anew: Collection[str]) -> list[Json]:
    """What was measured before, of other parts: a command may measure some of them anew."""
    if path is None or not path.is_file():
        return []
    return [record for record in read_results(path)["records"] if record[word] not in anew]


def depth_frames(
    folder: Path, names: Sequence[str] | None = None, masks: Path | None = None
) -> tuple[Frame, ...]:
    """The depth images of a folder of the data, all or those of some names."""
    inputs = [folder / "depth"]
    if names is not None:
        inputs = [folder / "depth" / f"{name}.png" for name in names]
    options = DepthOptions(intrinsics=folder / "intrinsics.json", masks=masks)
    return DepthImages(inputs=inputs, options=options).collect()
