"""Paired differences between two results of ``benchmarks/run.py``: B - A over sets and seeds.

python benchmarks/compare.py A.json B.json
"""

import sys
from pathlib import Path
from statistics import mean, stdev
from typing import Any

from results import read_results

METRICS = (
    *("right", "wrong", "rotation_mean", "rotation_max"),
    *("translation_mean", "translation_max", "seconds", "cpu_seconds", "peak_mb"),
)


def main() -> int:
    """Print one Markdown table; 2 if the arguments are not two files."""
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 2
    a, b = (_runs(Path(argument)) for argument in sys.argv[1:])
    print("| set | runs | " + " | ".join(METRICS) + " |")
    print("|" + "---|" * (len(METRICS) + 2))
    for name in dict.fromkeys(name for name, _ in a):
        both = [key for key in a if key[0] == name and key in b]
        cells = [_difference([(a[key].get(m), b[key].get(m)) for key in both]) for m in METRICS]
        print(f"| {name} | {len(both)} | " + " | ".join(cells) + " |")
    return 0


def _runs(path: Path) -> dict[tuple[str, int], dict[str, Any]]:
    return {(run["set"], run["seed"]): run for run in read_results(path)["records"]}


def _difference(pairs: list[tuple[float | None, float | None]]) -> str:
    """Mean of B - A and its spread over the runs that both have."""
    differences = [b - a for a, b in pairs if a is not None and b is not None]
    if not differences:
        return "-"
    spread = f" ± {stdev(differences):.3g}" if len(differences) > 1 else ""
    return f"{mean(differences):+.3g}{spread}"


if __name__ == "__main__":
    sys.exit(main())
