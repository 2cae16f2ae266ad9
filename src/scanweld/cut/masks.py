"""Which cells of a grid a cut kept, as text and back, and a scan of these alone."""

from dataclasses import replace

import numpy as np

from scanweld.geometry.arrays import BoolArray
from scanweld.geometry.scan import RangeScan


def mask_text(mask: BoolArray) -> str:
    """A mask (H, W) as text: rows x columns, then lengths of runs off, on, off ... row by row."""
    flat = np.concatenate([[False], mask.ravel(), [not mask.ravel()[-1:].any()]])
    ends = np.flatnonzero(flat[1:] != flat[:-1])
    lengths = np.diff(np.concatenate([[0], ends]))
    return f"{mask.shape[0]}x{mask.shape[1]} {','.join(map(str, lengths.tolist()))}"


def mask_of(text: str) -> BoolArray:
    """The mask (H, W) of a text.

    Raises:
        ValueError: If the text is none of a mask.
    """
    size, _, runs = text.partition(" ")
    rows, columns = (int(number) for number in size.split("x"))
    lengths = np.array([int(number) for number in runs.split(",")])
    if min(rows, columns) < 1 or lengths.min() < 0 or lengths.sum() != rows * columns:
        raise ValueError(f"runs of {lengths.sum()} cells do not fill {rows} x {columns}")
    return np.repeat(np.arange(len(lengths)) % 2 == 1, lengths).reshape(rows, columns)


def with_only(scan: RangeScan, kept: BoolArray) -> RangeScan:
    """A scan with the points of some cells of its grid alone, and a note that says so.

    Args:
        scan: With a grid.
        kept: (H, W) cells of the grid, or of one of every k-th row and column of it.

    Raises:
        ValueError: If the grid is another one.
    """
    if scan.grid is None:
        raise ValueError(f"{scan.name}: has no grid")
    step = -(-scan.grid.shape[0] // kept.shape[0])
    whole = kept.repeat(step, axis=0).repeat(step, axis=1)
    rows, columns = scan.grid.shape
    if whole.shape[0] < rows or whole.shape[1] < columns:
        raise ValueError(f"{scan.name}: its grid is not the one that was cut")
    on = whole[:rows, :columns] & (scan.grid >= 0)
    is_kept = np.zeros(len(scan.points), dtype=bool)
    is_kept[scan.grid[on]] = True
    share = on.sum() / max(int((scan.grid >= 0).sum()), 1)
    note = f"cut: table and background, {share:.1%} of the pixels kept"
    beyond = _background((scan.grid >= 0) & ~on, int(on.sum()))
    beyond = beyond if scan.seen_beyond is None else beyond | scan.seen_beyond
    return replace(scan.only(is_kept), seen_beyond=beyond, notes=(*scan.notes, note))


def _background(cut_off: BoolArray, num_kept: int) -> BoolArray:
    """What was cut off in patches larger than the object (H, W): smaller ones may be parts of it.

    A part before which nothing came back all around is cut off with the table.
    """
    from scipy import ndimage

    patch = np.zeros(cut_off.shape, dtype=np.int64)
    ndimage.label(cut_off, np.ones((3, 3)), output=patch)
    size = np.bincount(patch.ravel())
    size[0] = 0
    return (size > num_kept)[patch]
