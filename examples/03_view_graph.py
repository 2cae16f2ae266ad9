"""Learn to read the view graph: what each pair of scans says, and which pairs were believed."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import scanweld


def show_pairs(scans: Sequence[scanweld.RangeScan]) -> None:
    """Print a line a pair, the believed ones first, then the components."""
    result = scanweld.run(scans)
    for pair in sorted(result.pairs, key=lambda pair: not pair.accepted):
        sign = "=" if pair.accepted else " "
        score = "  none" if pair.score is None else f"{pair.score:6.2f}"
        print(f"{pair.i} {sign} {pair.j}  {pair.kind:<12}  score {score}  {pair.reason}")
    for names in result.components:
        print(f"component in the frame of {names[0]}: {', '.join(names)}")


if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        scanweld.simulate(
            scanweld.creature(voxels=70), Path(folder) / "scans", num_scans=5, pixels=140
        )
        show_pairs(scanweld.read_scans(Path(folder) / "scans"))
