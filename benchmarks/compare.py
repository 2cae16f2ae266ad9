"""Paired differences between two results of ``benchmarks.run``: B - A over sets and seeds.

python -m benchmarks.compare A.json B.json
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import mean, stdev

from benchmarks.blocks import rendered
from benchmarks.results import read_results
from benchmarks.run import COLUMNS

METRICS = ("right", "wrong", *(column.key for column in COLUMNS))


def main() -> int:
    """Print one Markdown table; 2 if the arguments are not two files."""
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 2
    documents = (read_results(Path(argument)) for argument in sys.argv[1:])
    a, b = ({(r["set"], r["seed"]): r for r in document["records"]} for document in documents)
    rows = {}
    for name in dict.fromkeys(name for name, _ in a):
        both = [key for key in a if key[0] == name and key in b]
        told = [difference([(a[key].get(m), b[key].get(m)) for key in both]) for m in METRICS]
        rows[name] = [len(both), *told]
    print(rendered("compare", metrics=METRICS, rows=rows), end="")
    return 0


def difference(pairs: Sequence[tuple[float | None, float | None]]) -> str:
    """Mean of B - A and its spread over the runs that both have."""
    differences = [b - a for a, b in pairs if a is not None and b is not None]
    if not differences:
        return "-"
    spread = f" ± {stdev(differences):.3g}" if len(differences) > 1 else ""
    return f"{mean(differences):+.3g}{spread}"


if __name__ == "__main__":
    sys.exit(main())
