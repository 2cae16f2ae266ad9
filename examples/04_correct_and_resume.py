"""Learn to correct a run by a fact: it is checked, and only what it touches is done again."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import scanweld


class Kept:
    """Finished work in memory; the command line keeps it in a folder."""

    def __init__(self) -> None:
        self.work: dict[str, object] = {}
        self.found = 0

    def get(self, key: str) -> object | None:
        """What was kept under a key, or None."""
        self.found += key in self.work
        return self.work.get(key)

    def put(self, key: str, value: object) -> None:
        """Keep finished work."""
        self.work[key] = value


def run_twice(scans: Sequence[scanweld.RangeScan]) -> None:
    """Run, say that two scans must not be laid together, and run again."""
    kept = Kept()
    result = scanweld.run(scans, cache=kept)
    print(f"first {result.verdict}: {len(result.poses)} scans are placed")
    pair = next(pair for pair in result.pairs if pair.accepted)

    fact = scanweld.Knowledge(apart=((pair.i, pair.j),))
    again = scanweld.run(scans, knowledge=fact, cache=kept)
    print(f"then {again.verdict}: {kept.found} pieces of work were found again")
    for report in again.knowledge:
        print(f"{report.fact}: {report.verdict}, {report.reason}")


if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        scans = Path(folder) / "scans"
        scanweld.simulate(scanweld.creature(voxels=70), scans, num_scans=6, pixels=180)
        run_twice(scanweld.read_scans(scans))
