"""Measure all tables of README.md, of benchmarks, model and depth in docs, and write these pages.

python -m benchmarks                     needs the data and half an hour
python -m benchmarks --quick --out DIR   small, without the data; the pages stay as they are
"""

import argparse
import subprocess
import sys
from pathlib import Path

from benchmarks import pages
from benchmarks.results import DATA

COMMANDS = {
    "run": ("sets", "--seeds 3"),
    "pairs": ("pairs", "--seeds 3 --keypoints heat even mixed --plot docs/pairs.png"),
    "model": ("model", ""),
    "depth": ("depth", ""),
}
"""Module -> its results, and options of the full measurement."""


def main() -> int:
    """0 if all ran and met their floors."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="small, without the data")
    parser.add_argument("--out", type=Path, default=DATA, help="folder of the results (docs/data)")
    options = parser.parse_args()
    codes = []
    for module, (name, full) in COMMANDS.items():
        how = ["--quick"] if options.quick else full.split()
        command = [sys.executable, "-m", f"benchmarks.{module}", *how]
        codes.append(subprocess.run([*command, "--out", options.out / f"{name}.json"]).returncode)
    return max(codes) if options.quick else max(*codes, pages.main())


if __name__ == "__main__":
    sys.exit(main())
