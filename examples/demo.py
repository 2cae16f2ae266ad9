"""Scan a creature with the virtual scanner, put the scans together, and compare with the truth.

    python examples/demo.py demo

Everything after the first step is what a user does with scans of a real object; the commands are
printed as they are run. Exit code 0 only if all scans are placed, and rightly.
"""

import shlex
import shutil
import sys
from pathlib import Path

from scanweld import creature, write_mesh_ply
from scanweld.app.cli import main  # the commands themselves, as the shell runs them


def demo(folder: Path) -> int:
    """Make the scans, run the main job on them, and evaluate its poses."""
    scans, model, truth = folder / "scans", folder / "model", folder / "scans/truth/poses.json"
    if truth.exists():
        shutil.rmtree(scans)  # of an earlier demo
    folder.mkdir(parents=True, exist_ok=True)
    write_mesh_ply(folder / "creature.ply", creature())
    options = ["--num-scans", "10", "--seed", "1"]
    if code := scanweld("simulate", folder / "creature.ply", "-o", scans, *options):
        return code
    verdict = scanweld("run", scans, "-o", model, "--force")
    if not (model / "poses.json").exists():
        return verdict
    return scanweld("evaluate", model / "poses.json", truth, "--scans", scans) or verdict


def scanweld(*arguments: str | Path) -> int:
    """Run a command of scanweld as the shell would, and return its exit code."""
    words = [str(argument) for argument in arguments]
    print(f"\n$ scanweld {shlex.join(words)}", flush=True)
    try:
        main(words)
    except SystemExit as left:
        return left.code if isinstance(left.code, int) else 0
    return 0


if __name__ == "__main__":
    sys.exit(demo(Path(sys.argv[1] if len(sys.argv) > 1 else "demo")))
