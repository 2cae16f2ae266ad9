"""Numbers in text, to the bit as Python reads them; what is none is refused in one line."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scanweld.errors import ReadError
from scanweld.io import read_scan
from scanweld.io.scan_formats.stl import _merged
from scanweld.io.text import parse_numbers

HEADER = "ply\nformat ascii 1.0\n{}element vertex {}\n"
BODY = "property float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n1 0 0\n0 1 0\n"


def test_a_superscript_counts_no_vertices(tmp_path: Path):
    path = tmp_path / "scan.ply"
    path.write_text(HEADER.format("", "3²") + BODY, encoding="utf-8")
    with pytest.raises(ReadError, match="is not 'element NAME COUNT'"):
        read_scan(path, "scan")


SIMPLE = (
    "0 -0 +0.0 -0.e5 1. -.5 +.5e-3 1E22 9e-22 000001 123456789012345 123456789012345e-22 0.1 1e+5"
)
ODD = (
    "1e23 1234567890123456 0.30000000000000004 1e-400 1e400 4.9e-324 inf -Infinity nan "
    "0.0000000000000000000001234 1e99999999999999999999 123456789012345678e-5"
)


@pytest.mark.parametrize("space", [" ", "\n", "\r\n", "\t \v\f"])
@pytest.mark.parametrize("words", [SIMPLE, ODD, f"{SIMPLE} {ODD}", f"{SIMPLE} {SIMPLE} {ODD}", ""])
def test_numbers_are_those_of_python_to_the_bit(words: str, space: str):
    text = space.join(["", *words.split(), ""]).encode()
    want = np.array([float(word) for word in words.split()], dtype=np.float64)
    for cut in (text, text.strip()):
        assert parse_numbers(Path("x"), cut).tobytes() == want.tobytes()


@given(st.lists(st.floats(width=64) | st.integers(-(10**20), 10**20), max_size=50), st.data())
def test_any_number_in_any_number_of_digits(values: list[float], data: st.DataObject):
    forms = st.sampled_from(["{!r}", "{:.6f}", "{:.9e}", "{:.14g}", "{:.18e}"])
    words = [data.draw(forms).format(value) for value in values]
    want = np.array([float(word) for word in words], dtype=np.float64)
    assert parse_numbers(Path("x"), " ".join(words).encode()).tobytes() == want.tobytes()


@pytest.mark.parametrize(
    "word", ["-", ".", "1e", "1e+", "--1", "1.2.3", "e5", "1e5.", "0x1", "1-2", "1_0"]
)
def test_what_is_no_number_is_named_with_its_line(word: str):
    with pytest.raises(ReadError, match=f"line 8: {re.escape(repr(word.encode())[1:])} is not"):
        parse_numbers(Path("x"), f"1 2\n\n{word} 4".encode(), first_line=6)


@given(st.integers(0, 60), st.integers(0, 2**32 - 1))
def test_corners_merge_into_points_as_they_appear(count: int, seed: int):
    rng = np.random.default_rng(seed)
    corners = rng.choice([0.0, -0.0, 1.0, 2.5, np.nan], (count, 3), p=[0.3, 0.2, 0.2, 0.2, 0.1])
    points, index = _merged(corners + 0.0)
    assert np.array_equal(points[index], corners, equal_nan=True)
    assert (np.diff(np.unique(index, return_index=True)[1]) > 0).all()
    whole = ~np.isnan(points).any(axis=1)
    assert len(np.unique(points[whole] + 0.0, axis=0)) == whole.sum()
    assert (~whole).sum() == np.isnan(corners).any(axis=1).sum()
