"""Broken files: truncated, lying about counts, with huge numbers, deep nests, bombs, and so on."""

import gzip
import io
import re
import zipfile
import zlib

import numpy as np

_NUMBER = re.compile(rb"-?\d+(\.\d+)?")
_EXTREMES = (0, 1, -1, 255, 2**15, 2**31 - 1, 2**31, 2**32 - 1, 2**53, 2**63 - 1, 2**64 - 1, 10**30)
_SPELLED = (b"", b"nan", b"-inf", b"1e308", b"-1e999", b"0x10", b"1" * 5000, b"3.5", b"\xb2")
_NESTS = (b"[", b"(", b"{", b'{"a":', b"<a>", b"-")


_BOMB = 2**27
_BOMB_SHARE = 0.02
_E57_PAGE = 1024
_SUMS = np.arange(256, dtype=np.uint32)
"""What a byte adds to a checksum by Castagnoli's polynomial."""
for _ in range(8):
    _SUMS = (_SUMS >> 1) ^ np.where(_SUMS & 1, np.uint32(0x82F63B78), np.uint32(0))


def broken_file(name: str, data: bytes, rng: np.random.Generator) -> bytes:
    """A mutated file. Half of those that are packed or have checksums are mutated below these."""
    suffix = name.rpartition(".")[2]
    if suffix not in ("gz", "npz", "png", "e57") or rng.random() < 0.5:
        return mutated(data, rng)
    bomb = bytes(_BOMB) if rng.random() < _BOMB_SHARE else b""
    if suffix == "gz":
        inner = mutated(gzip.decompress(data), rng)
        return gzip.compress(inner + bomb, compresslevel=1, mtime=0)
    if suffix == "npz":
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            inner = {each: mutated(archive.read(each), rng) for each in archive.namelist()}
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
            for each, content in inner.items():
                archive.writestr(each, content + bomb)
        return stream.getvalue()
    return {"png": _sealed_png, "e57": _sealed_e57}[suffix](mutated(data, rng))


def _sealed_png(data: bytes) -> bytes:
    """The same with right checksums, as far as its chunks can be followed."""
    out, at = bytearray(data), 8
    while at + 12 <= len(out):
        end = at + 8 + int.from_bytes(out[at : at + 4], "big")
        if end + 4 > len(out):
            break
        out[end : end + 4] = zlib.crc32(out[at + 4 : end]).to_bytes(4, "big")
        at = end + 4
    return bytes(out)


def _sealed_e57(data: bytes) -> bytes:
    """The same with right checksums (CRC-32C) at the ends of its pages."""
    count = len(data) // _E57_PAGE
    pages = np.frombuffer(data[: count * _E57_PAGE], np.uint8).reshape(count, _E57_PAGE).copy()
    sums = np.full(count, 0xFFFFFFFF, dtype=np.uint32)
    for column in pages[:, :-4].T:
        sums = (sums >> 8) ^ _SUMS[(sums ^ column) & 255]
    pages[:, -4:] = (~sums).astype(">u4").view(np.uint8).reshape(count, 4)
    return pages.tobytes() + data[count * _E57_PAGE :]


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """The bytes with one to three things wrong."""
    for _ in range(int(rng.integers(1, 4))):
        data = _MUTATIONS[int(rng.integers(len(_MUTATIONS)))](data, rng)
    return data


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
