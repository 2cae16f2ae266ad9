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
from collections.abc import Sequence
from pathlib import Path
from statistics import median

from benchmarks.blocks import judged, markdown_table
from benchmarks.kept import warn_of_old_calibration
from benchmarks.results import Json, write_results
from benchmarks.sets import QUICK, SETS, BenchmarkSet, data_folder, make_set
from scanweld.evaluation.metrics import PoseErrors, Standing, evaluate_poses
from scanweld.io import PoseSet, read_poses

ALL = {**SETS, **QUICK}
COLUMNS = (
    ("rotation_mean", "rotation mean (deg)", median, 3),
    ("rotation_max", "rotation max (deg)", max, 3),
    ("translation_mean", "translation mean (%)", median, 3),
    ("translation_max", "translation max (%)", max, 3),
    ("seconds", "wall (s)", median, 1),
    ("cpu_seconds", "CPU (s)", median, 1),
    ("peak_mb", "peak (MB)", max, 0),
)
"""Key of a run and of the floors, heading, how seeds are put together, digits."""


def main() -> int:
    """Run the sets; 0 if all floors are met, else 1."""
    options = _options()
    warn_of_old_calibration()
    names, seeds = (list(QUICK), 1) if options.quick else (options.sets, options.seeds)
    runs: list[Json] = []
    for name in names:
        for seed in range(seeds):
            runs.append(run_set(name, seed, options))
            _show_progress(runs[-1])
            if options.out:
                write_results(options.out, runs)
    print(table(runs), end="")
    return 0 if all(ALL[run["set"]].is_met(run) for run in runs) else 1


def run_set(name: str, seed: int, options: argparse.Namespace) -> Json:
    """Make a set, run the command on it in a process of its own, and evaluate its poses."""
    with tempfile.TemporaryDirectory(prefix="scanweld-") as temporary:
        folder, out = Path(temporary) / "scans", Path(temporary) / "model"
        truth = make_set(ALL[name], seed, folder, data_folder(options.data))
        command = [_executable(), "run", str(folder), "-o", str(out), *options.extra]
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
    errors = evaluate_poses(found, truth.poses, centroids=truth.centroids, diameter=truth.diameter)
    return {
        "set": name,
        "seed": seed,
        "verdict": report.get("verdict", "error"),
        **usage,
        "stages": report.get("stages", {}),
        **summary(errors),
        "scans": {
            truth.originals[name]: {
                "standing": str(error.standing),
                "rotation_deg": error.rotation_deg,
                "translation_percent": 100.0 * error.translation / truth.diameter,
            }
            for name, error in sorted(errors.scans.items())
            if error.standing is not Standing.UNPLACED
        },
    }


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


def summary(errors: PoseErrors) -> Json:
    """Counts, and mean and largest errors of the placed scans (None if there are none)."""
    counts: Json = {str(standing): errors.count(standing) for standing in Standing}
    measured = {"rotation": errors.rotations_deg, "translation": errors.translations_percent}
    for name, values in measured.items():
        counts[f"{name}_mean"] = float(values.mean()) if len(values) else None
        counts[f"{name}_max"] = float(values.max()) if len(values) else None
    return counts


def table(runs: Sequence[Json]) -> str:
    """Markdown, one line a set."""
    headings = ("set", "seeds", "right", "wrong", *(c[1] for c in COLUMNS), "verdicts")
    by_set = {name: [r for r in runs if r["set"] == name] for name in {r["set"]: 0 for r in runs}}
    rows = [(name, len(of), *_cells(of, ALL[name])) for name, of in by_set.items()]
    return markdown_table(headings, rows)


def _cells(runs: Sequence[Json], wanted: BenchmarkSet) -> list[str]:
    right, wrong = min(run["right"] for run in runs), max(run["wrong"] for run in runs)
    cells = [
        judged(f"{right}/{wanted.num_scans}", right >= wanted.num_scans),
        judged(str(wrong), wrong == 0),
    ]
    for key, _, together, digits in COLUMNS:
        values = [run[key] for run in runs if run[key] is not None]
        floor = wanted.floors.get(key)
        text = f"{together(values):.{digits}f}" if values else "-"
        if floor is None or not values:
            cells.append(judged(text, floor is None))
        else:
            cells.append(judged(f"{text} ({floor:g})", together(values) <= floor))
    return [*cells, " ".join(sorted({run["verdict"] for run in runs}))]


def _executable() -> str:
    """The command that is installed beside this Python, else the one on the path."""
    beside = Path(sys.executable).with_name("scanweld")
    return str(beside) if beside.exists() else "scanweld"


def _show_progress(run: Json) -> None:
    counts = ", ".join(f"{run[str(standing)]} {standing}" for standing in Standing)
    told = f"{run['set']} seed {run['seed']}: {counts}, {run['verdict']}, {run['seconds']:.1f} s"
    print(told, file=sys.stderr, flush=True)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Run the main job on sets of scans.")
    parser.add_argument("--sets", nargs="+", choices=list(ALL), default=list(SETS), metavar="SET")
    parser.add_argument("--seeds", type=int, default=3, help="number of orders, names and frames")
    parser.add_argument("--quick", action="store_true", help="one small set that needs no data")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--data", type=Path, help="folder of the Stanford data")
    parser.add_argument("--out", type=Path, help="JSON file of all runs")
    parser.add_argument("--keep", type=Path, help="folder for the models of all runs")
    parser.add_argument("--cold", action="store_true", help="compile anew, as after installation")
    parser.add_argument("extra", nargs="*", help="further options of scanweld run, after --")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
