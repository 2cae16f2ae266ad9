"""Mutated files of every format: a reader reads them, or refuses them in a line.

``python -m benchmarks.fuzz`` mutates each small file of ``sample_files`` 2,000 times (truncation,
lies about counts, huge numbers, swapped bytes, deep nesting, bombs) and reads the result, in a
process of its own. It prints a line a file, and exits with 1 if anything but ``ReadError`` was
raised, a process ended by itself, or a file took more than 5 s or 1 GB.
"""

import argparse
import gzip
import io
import re
import subprocess
import sys
import tempfile
import time
import warnings
import zipfile
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from benchmarks.sample_files import SAMPLES, WITH_LIBRARIES, npy, surface
from scanweld.errors import ReadError
from scanweld.io import read_scan
from scanweld.io.read import part_names

MOST_SECONDS = 5.0
"""That a file of a few kilobytes may take,"""
MOST_MEGABYTES = 1024
"""and the memory that all of a format's files may."""

_NUMBER = re.compile(rb"-?\d+(\.\d+)?")
_EXTREMES = (0, 1, -1, 255, 2**15, 2**31 - 1, 2**31, 2**32 - 1, 2**53, 2**63 - 1, 2**64 - 1, 10**30)
_SPELLED = (b"", b"nan", b"-inf", b"1e308", b"-1e999", b"0x10", b"1" * 5000, b"3.5", b"\xb2")
_NESTS = (b"[", b"(", b"{", b'{"a":', b"<a>", b"-")

TEXTS = {
    "a.xyz": "4\nx y z\n0 0 1 0 1 0\n1,0,2,1,0,0\n0;1;3;0;0;1\n1 1 1 0 0 1\n",
    "a.obj": "# o\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nvn 0 0 1\nf 1//1 2/3 -1\n",
    "a.off": "COFF\n3 1 0\n0 0 0 9 9 9 255\n1 0 0 9 9 9 255\n0 1 0 9 9 9 255\n3 0 1 2\n",
    "a.stl": "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
    "vertex 0 1 0\nendloop\nendfacet\nendsolid a\n",
    "mesh.ply": "ply\nformat ascii 1.0\nobj_info num_cols 2\nobj_info num_rows 2\n"
    "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "property uchar intensity\nelement range_grid 4\nproperty list uchar int vertex_indices\n"
    "end_header\n0 0 0 1\n1 0 0 2\n1 1 0 3\n0 1 0 4\n1 0\n1 1\n0\n1 2\n",
}


def samples() -> dict[str, Callable[[], bytes]]:
    """Makers of small whole files by their names: those whose libraries are here."""
    texts = {name: partial(str.encode, text) for name, text in TEXTS.items()}
    others = {name: make for name, (lib, make) in WITH_LIBRARIES.items() if find_spec(lib)}
    return {**texts, **SAMPLES, **others}


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """The bytes with one to three things wrong."""
    for _ in range(int(rng.integers(1, 4))):
        data = _MUTATIONS[int(rng.integers(len(_MUTATIONS)))](data, rng)
    return data


def broken_file(name: str, data: bytes, rng: np.random.Generator) -> bytes:
    """A mutated file; half of the packed ones are packed anew after what they hold was mutated."""
    if name.endswith(".gz") and rng.random() < 0.5:
        inner = gzip.decompress(data)
        bomb = bytes(2**27) if rng.random() < 0.02 else b""
        return gzip.compress(mutated(inner, rng) + bomb, compresslevel=1, mtime=0)
    if name.endswith(".npz") and rng.random() < 0.5:
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("points.npy", mutated(npy(surface()), rng))
        return stream.getvalue()
    return mutated(data, rng)


def read_all(path: Path) -> bool:
    """Read all scans of a file; whether they can be.

    Raises:
        Exception: Whatever the reader raises that is no ``ReadError`` of one line.
    """
    try:
        for part in range(len(part_names(path))):
            assert len(read_scan(path, part=part).points)
    except ReadError as error:
        assert "\n" not in str(error) and str(error).startswith(str(path)), str(error)
        return False
    return True


def _at(data: bytes, rng: np.random.Generator) -> int:
    """Somewhere in the data: half of the time in its first 600 bytes, where heads are."""
    reach = min(len(data), 600) if rng.random() < 0.5 else len(data)
    return int(rng.integers(reach + 1))


def _cut(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: _at(data, rng)]


def _overwritten(data: bytes, rng: np.random.Generator) -> bytes:
    at, size = _at(data, rng), int(rng.integers(1, 9))
    return data[:at] + rng.bytes(size) + data[at + size :]


def _inserted(data: bytes, rng: np.random.Generator) -> bytes:
    at = _at(data, rng)
    return data[:at] + rng.bytes(int(rng.integers(1, 40))) + data[at:]


def _removed(data: bytes, rng: np.random.Generator) -> bytes:
    at = _at(data, rng)
    return data[:at] + data[at + int(rng.integers(1, 40)) :]


def _lying(data: bytes, rng: np.random.Generator) -> bytes:
    """A number in text is another one."""
    found = list(_NUMBER.finditer(data))
    if not found:
        return _huge(data, rng)
    which = found[int(len(found) * rng.random() ** 2)]
    choices = (*(str(number).encode() for number in _EXTREMES), *_SPELLED)
    return data[: which.start()] + choices[int(rng.integers(len(choices)))] + data[which.end() :]


def _huge(data: bytes, rng: np.random.Generator) -> bytes:
    """Some bytes are an extreme number, in either order."""
    at, size = _at(data, rng), int(rng.choice([1, 2, 4, 8]))
    number = _EXTREMES[int(rng.integers(len(_EXTREMES)))] % 256**size
    order = "little" if rng.random() < 0.5 else "big"
    return data[:at] + number.to_bytes(size, order) + data[at + size :]


def _swapped(data: bytes, rng: np.random.Generator) -> bytes:
    """From somewhere on, the bytes of every word stand in the other order."""
    at, size = _at(data, rng), int(rng.choice([2, 4, 8]))
    end = at + (len(data) - at) // size * size
    words = np.frombuffer(data[at:end], np.uint8).reshape(-1, size)
    return data[:at] + words[:, ::-1].tobytes() + data[end:]


def _repeated(data: bytes, rng: np.random.Generator) -> bytes:
    at = _at(data, rng)
    piece = data[at : at + int(rng.integers(1, 200))]
    return data[:at] + piece * int(rng.integers(2, 40)) + data[at:]


def _nested(data: bytes, rng: np.random.Generator) -> bytes:
    at = _at(data, rng)
    return data[:at] + _NESTS[int(rng.integers(len(_NESTS)))] * 20_000 + data[at:]


def _exchanged(data: bytes, rng: np.random.Generator) -> bytes:
    """Two lines have changed places."""
    lines = data.split(b"\n")
    i, j = rng.integers(len(lines), size=2)
    lines[i], lines[j] = lines[j], lines[i]
    return b"\n".join(lines)


_MUTATIONS = (
    *(_cut, _overwritten, _inserted, _removed, _lying, _lying, _lying),
    *(_huge, _huge, _swapped, _repeated, _nested, _exchanged),
)


def fuzz(name: str, count: int, seed: int) -> int:
    """Read so many mutated files of one format, print a line, and tell how many went wrong."""
    warnings.simplefilter("error")
    data, wrong, slowest, num_read = samples()[name](), 0, 0.0, 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        for k in range(count):
            path.write_bytes(broken_file(name, data, np.random.default_rng((seed, k))))
            begin = time.process_time()
            try:
                num_read += read_all(path)
            except Exception as error:
                wrong += 1
                print(f"{name}: file {k}: {type(error).__name__}: {str(error)[:200]}")
            slowest = max(slowest, time.process_time() - begin)
    peak = _peak_megabytes()
    print(
        f"{name:15} {count} files: {num_read} read, {count - num_read - wrong} refused, {wrong} "
        f"wrong; slowest {slowest:.2f} s, memory {peak:.0f} MB"
    )
    return wrong + (slowest > MOST_SECONDS) + (peak > MOST_MEGABYTES)


def _peak_megabytes() -> float:
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> int:
    """Fuzz all formats, each in a process of its own."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2000, help="Files of each format.")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", help="One of the files.")
    options = parser.parse_args()
    if options.only:
        return int(fuzz(options.only, options.count, options.seed) > 0)
    wrong = 0
    for name in samples():
        numbers = ["--count", str(options.count), "--seed", str(options.seed)]
        command = [sys.executable, "-m", "benchmarks.fuzz", "--only", name, *numbers]
        code = subprocess.run(command, check=False).returncode
        if code not in (0, 1):
            print(f"{name}: the process ended with {code}")
        wrong += code != 0
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
