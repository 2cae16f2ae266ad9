"""Mutated files of every format: a reader reads them, or refuses them in a line.

    python -m benchmarks.fuzz                    2,000 files of each format, kept as it goes on
    python -m benchmarks.fuzz --formats two.ptx  of some of them; the others' records stay

Scans, depth images, intrinsics and poses are mutated (truncation, lies about counts, huge numbers,
swapped bytes, deep nests, bombs) and read, each format in a process of its own. Anything but one
line of a ``ScanweldError`` is wrong. So is a process that ends by itself, a file that takes more
than 5 s, and more memory than 1 GB. The exit code is then 1. ``python -m benchmarks.pages`` writes
the table of docs/formats.md.
"""

import argparse
import logging
import multiprocessing
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path, PurePath

import numpy as np

from benchmarks.mutations import broken_file
from benchmarks.results import DATA, Json, read_results, write_results
from benchmarks.sample_files import DEPTH_IMAGES, SAMPLES, WITH_LIBRARIES
from benchmarks.sample_texts import INTRINSICS, SCANS, poses
from scanweld.errors import ScanweldError
from scanweld.io import read_scan
from scanweld.io.depth.capture import DepthImages, DepthOptions
from scanweld.io.depth.intrinsics import read_intrinsics
from scanweld.io.pose_formats import match_all_poses, read_any_poses
from scanweld.io.read import part_names
from scanweld.io.scan_formats.registry import format_of
from scanweld.work.stage_log import peak_memory_mb

FLOORS = {"seconds": 5.0, "megabytes": 1024.0}
"""That a file of a few kilobytes may take, and the memory that all of a format's may."""
WARM = 20
"""Files before those that are timed: compiled code is loaded when it is first needed."""
RESULTS = DATA / "fuzz.json"


def samples() -> dict[str, Callable[[], bytes]]:
    """Makers of small whole files by their names: those whose libraries are here."""
    others = {name: make for name, (lib, make) in WITH_LIBRARIES.items() if find_spec(lib)}
    depth = {f"depth/{name}": make for name, make in DEPTH_IMAGES.items()}
    texts = {
        **SCANS,
        **{f"intrinsics/{name}": text for name, text in INTRINSICS.items()},
        **{f"poses/{name}": text for name, text in poses().items()},
    }
    return {**{name: text.encode for name, text in texts.items()}, **SAMPLES, **others, **depth}


def read_all(name: str, path: Path) -> bool:
    """Read all that a file holds, as what its name among the samples says; whether that can be.

    Raises:
        Exception: Whatever the reader raises that is no ``ScanweldError`` of one line.
    """
    readers = {"depth": _read_depth, "intrinsics": read_intrinsics, "poses": _read_poses}
    try:
        readers.get(name.partition("/")[0], _read_scans)(path)
    except ScanweldError as error:
        assert "\n" not in str(error) and str(error).startswith(str(path.parent)), str(error)
        return False
    return True


def _read_scans(path: Path) -> None:
    for part in range(len(part_names(path))):
        assert len(read_scan(path, part=part).points)


def _read_depth(path: Path) -> None:
    intrinsics = path.with_name("intrinsics.txt")
    intrinsics.write_text("9 9 3 3")
    options = DepthOptions(intrinsics=intrinsics)
    for file in DepthImages(inputs=[path], options=options).collect():
        assert len(file.read().points)


def _read_poses(path: Path) -> None:
    named = path.parent if path.parent.name == "cloudcompare" else path
    match_all_poses(named, read_any_poses(named), ["one", "two"])


def fuzz(name: str, count: int, seed: int) -> Json:
    """Read so many mutated files of one format, print what went wrong, and count."""
    warnings.simplefilter("error")
    logging.disable()
    data, wrong, slowest, num_read = samples()[name](), 0, 0.0, 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        assert read_all(name, path), name
        for k in range(-WARM, count):
            path.write_bytes(broken_file(name, data, np.random.default_rng((seed, k % 2**32))))
            begin = time.process_time()
            try:
                is_read = read_all(name, path)
            except Exception as error:
                wrong += 1
                is_read = False
                place = traceback.extract_tb(error.__traceback__)[-1]
                where = f"{Path(place.filename).name}:{place.lineno}"
                print(f"{name}: file {k}: {type(error).__name__}: {str(error)[:200]} ({where})")
            if k >= 0:
                num_read += is_read
                slowest = max(slowest, time.process_time() - begin)
    return {
        **{"name": name, "files": count, "read": num_read, "wrong": wrong},
        **{"seconds": slowest, "megabytes": peak_memory_mb()},
    }


def by_format(records: Sequence[Json]) -> Json:
    """The records of the files of each format as one, and the floors."""
    grouped: dict[str, list[Json]] = {}
    for record in records:
        folder, slash, _ = record["name"].partition("/")
        form = format_of(PurePath(record["name"]))
        title = folder if slash or form is None else " ".join(form.suffixes)
        grouped.setdefault(title, []).append(record)
    formats = [
        {
            "title": title,
            **{key: sum(r[key] for r in of) for key in ("files", "read", "wrong")},
            **{key: max(r[key] for r in of) for key in ("seconds", "megabytes")},
        }
        for title, of in sorted(grouped.items())
    ]
    return {"formats": formats, "floors": FLOORS}


def is_sound(record: Json) -> bool:
    """Whether all went as it should with the files of a format."""
    return not record["wrong"] and all(record[key] <= most for key, most in FLOORS.items())


def main() -> int:
    """Fuzz formats, each in a process of its own."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2000, help="Files of each format.")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--formats", nargs="+", choices=samples(), default=tuple(samples()))
    parser.add_argument("--out", type=Path, default=RESULTS, help="Where the results go.")
    options = parser.parse_args()
    records = {}
    if options.out.is_file():
        records = {record["name"]: record for record in read_results(options.out)["records"]}
    for name in options.formats:
        records[name] = _in_process(name, options.count, options.seed)
        write_results(options.out, [records[name] for name in samples() if name in records])
    return int(not all(map(is_sound, records.values())))


def _in_process(name: str, count: int, seed: int) -> Json:
    """The record of a format, which is printed."""
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=lambda: sender.send(fuzz(name, count, seed)))
    process.start()
    sender.close()
    try:
        record = receiver.recv()
    except EOFError:  # it ended by itself
        record = {"name": name, "files": count, "read": 0, "wrong": count}
        record |= {"seconds": 0.0, "megabytes": 0.0}
    process.join()
    print(f"{record} {process.exitcode or ''}", flush=True)
    return record


if __name__ == "__main__":
    sys.exit(main())
