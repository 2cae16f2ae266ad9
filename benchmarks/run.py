"""Run the main job on sets of scans, as users do, and hold its poses against the reference.

    python -m benchmarks.run --sets bunny10 dragon15 --seeds 3 --workers 2 --out results.json
    python -m benchmarks.run --quick

Every seed gives the files another order, neutral names and random frames. The table shows, over the
seeds: the fewest right, the most wrong, medians of the mean errors, the largest of the maximum
errors, median times and largest peak memory; beside each number its floor, and FAIL where it is
missed.
"""

import argparse
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from typing import NamedTuple

from benchmarks.blocks import rendered
from benchmarks.kept import warn_of_old_calibration
from benchmarks.results import Json, write_results
from benchmarks.sets import QUICK, SETS, Truth, data_folder, make_set
from scanweld.evaluation.metrics import PoseErrors, Standing, evaluate_poses
from scanweld.io import PoseSet, read_poses


class Column(NamedTuple):
    """A value of a run that has a column in the table."""

    key: str  # Of the run, and of the floors
    heading: str
    together: Callable[[list[float]], float]  # How seeds are put together
    digits: int


COLUMNS = (
    Column("rotation_mean", "rotation mean (deg)", median, 3),
    Column("rotation_max", "rotation max (deg)", max, 3),
    Column("translation_mean", "translation mean (%)", median, 3),
    Column("translation_max", "translation max (%)", max, 3),
    Column("seconds", "wall (s)", median, 1),
    Column("cpu_seconds", "CPU (s)", median, 1),
    Column("peak_mb", "peak (MB)", max, 0),
)


def main() -> int:
    """Run the sets; 0 if all floors are met, else 1."""
    parser = argparse.ArgumentParser(description="Run the main job on sets of scans.")
    add = parser.add_argument
    add("--sets", nargs="+", choices=SETS, default=[n for n in SETS if n != QUICK], metavar="SET")
    add("--seeds", type=int, default=3, help="number of orders, names and frames")
    add("--quick", action="store_true", help="one small set that needs no data")
    add("--workers", type=int, default=2)
    add("--data", type=Path, help="folder of the Stanford data")
    add("--out", type=Path, help="JSON file of all runs")
    add("--keep", type=Path, help="folder for the models of all runs")
    add("--cold", action="store_true", help="compile anew, as after installation")
    add("extra", nargs="*", help="further options of scanweld run, after --")
    options = parser.parse_args()
    warn_of_old_calibration()
    names, seeds = ([QUICK], 1) if options.quick else (options.sets, options.seeds)
    runs: list[Json] = []
    for name in names:
        for seed in range(seeds):
            runs.append(run_set(name, seed, options))
            counts = ", ".join(f"{runs[-1][str(standing)]} {standing}" for standing in Standing)
            print(f"{name} seed {seed}: {counts}", file=sys.stderr, flush=True)
            if options.out:
                write_results(options.out, runs)
    print(rendered("sets", **over_seeds(runs)), end="")
    return 0 if all(SETS[run["set"]].is_met(run) for run in runs) else 1


def run_set(name: str, seed: int, options: argparse.Namespace) -> Json:
    """Make a set, run the command on it in a process of its own, and evaluate its poses."""
    with tempfile.TemporaryDirectory(prefix="scanweld-") as temporary:
        folder, out = Path(temporary) / "scans", Path(temporary) / "model"
        truth = make_set(SETS[name], seed, folder, data_folder(options.data))
        command = scanweld_command("run", folder, "-o", out, *options.extra)
        environment = dict(os.environ)
        if options.cold:
            environment["NUMBA_CACHE_DIR"] = str(Path(temporary) / "compiled")
        usage = timed([*command, "--workers", str(options.workers), "-q"], environment)
        found, report = PoseSet(poses={}, components=()), {}
        if (out / "poses.json").exists():
            found = read_poses(out / "poses.json")
            report = json.loads((out / "report.json").read_text(encoding="utf-8"))
        if options.keep and out.exists():
            shutil.copytree(out, options.keep / f"{name}-{seed}", dirs_exist_ok=True)
    errors = evaluated(found, truth)
    measured = {"rotation": errors.rotations_deg, "translation": errors.translations_percent}
    return {
        **{"set": name, "seed": seed, "verdict": report.get("verdict", "error")},
        **usage,
        "stages": report.get("stages", {}),
        **{str(standing): errors.count(standing) for standing in Standing},
        # Of the placed scans; None if there are none.
        **{f"{k}_mean": float(v.mean()) if len(v) else None for k, v in measured.items()},
        **{f"{k}_max": float(v.max()) if len(v) else None for k, v in measured.items()},
        "scans": {
            truth.originals[scan]: {
                "standing": str(error.standing),
                "rotation_deg": error.rotation_deg,
                "translation_percent": 100.0 * error.translation / truth.diameter,
            }
            for scan, error in sorted(errors.scans.items())
            if error.standing is not Standing.UNPLACED
        },
    }


def scanweld_command(*words: object) -> list[str]:
    """The command that is installed beside this Python, else the one on the path."""
    beside = Path(sys.executable).with_name("scanweld")
    return [str(beside) if beside.exists() else "scanweld", *map(str, words)]


def evaluated(found: PoseSet, truth: Truth) -> PoseErrors:
    """What became of the scans of a made set."""
    return evaluate_poses(found, truth.poses, centroids=truth.centroids, diameter=truth.diameter)


def timed(command: list[str], environment: dict[str, str]) -> dict[str, float]:
    """Exit code, wall and CPU seconds, and peak resident megabytes of a command."""
    start = time.perf_counter()
    # Its output goes to stderr: stdout is the table's.
    process = subprocess.Popen(
        command, env=environment, stdin=subprocess.DEVNULL, stdout=sys.stderr.fileno()
    )
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    in_kilobytes = 1024.0 if platform.system() == "Darwin" else 1.0
    return {
        "exit_code": process.returncode,
        "seconds": time.perf_counter() - start,
        "cpu_seconds": usage.ru_utime + usage.ru_stime,
        "peak_mb": usage.ru_maxrss / in_kilobytes / 1024.0,
    }


def over_seeds(runs: Sequence[Json]) -> Json:
    """The sets, what each reached over its seeds, and the columns of the table."""
    names = dict.fromkeys(run["set"] for run in runs)
    sets = [_over_seeds(name, [run for run in runs if run["set"] == name]) for name in names]
    return {"columns": COLUMNS, "sets": sets}


def _over_seeds(name: str, runs: Sequence[Json]) -> Json:
    known = {c: [run[c.key] for run in runs if run[c.key] is not None] for c in COLUMNS}
    return {
        **{"name": name, "wanted": SETS[name], "runs": len(runs)},
        **{"right": min(run["right"] for run in runs), "wrong": max(run["wrong"] for run in runs)},
        **{c.key: c.together(values) if values else None for c, values in known.items()},
        "verdicts": sorted({run["verdict"] for run in runs}),
    }


if __name__ == "__main__":
    sys.exit(main())
