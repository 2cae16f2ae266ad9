"""Run the main job on sets of scans, as users do, and hold its poses against the reference.

    python benchmarks/run.py --sets bunny10 dragon15 --seeds 3 --workers 2 --out results.json

Every seed gives the files another order, neutral names and random frames. The table shows, over the
seeds: the fewest right, the most wrong, medians of the mean errors, the largest of the maximum
errors, median times and largest peak memory; beside each number its floor, and FAIL where it is
missed.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

from results import write_results
from scanweld.evaluation.metrics import PoseErrors, Standing, evaluate_poses
from scanweld.io import PoseSet, read_poses
from sets import SETS, BenchmarkSet, Floors, Truth, data_folder, make_set

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
    runs: list[dict[str, Any]] = []
    for name in options.sets:
        for seed in range(options.seeds):
            run = run_set(name, seed, options)
            runs.append(run)
            print(_progress_line(run), file=sys.stderr, flush=True)
            if options.out:
                write_results(options.out, runs)
    rows, is_passed = table(runs)
    print("\n".join(rows))
    return 0 if is_passed else 1


def run_set(name: str, seed: int, options: argparse.Namespace) -> dict[str, Any]:
    """Make a set, run the command on it in a process of its own, and evaluate its poses."""
    wanted: BenchmarkSet = SETS[name]
    with tempfile.TemporaryDirectory(prefix="scanweld-") as temporary:
        folder, out = Path(temporary) / "scans", Path(temporary) / "model"
        truth = make_set(wanted, seed, folder, data_folder(options.data))
        command = [_executable(), "run", str(folder), "-o", str(out), *options.extra]
        command += ["--workers", str(options.workers), "-q"]
        environment = dict(os.environ)
        if options.cold:
            environment["NUMBA_CACHE_DIR"] = str(Path(temporary) / "compiled")
        usage = timed(command, environment)
        found, report = _outcome(out)
        if options.keep:
            _keep(out, options.keep / f"{name}-{seed}")
    errors = evaluate_poses(found, truth.poses, centroids=truth.centroids, diameter=truth.diameter)
    return {
        "set": name,
        "seed": seed,
        "verdict": report.get("verdict", "error"),
        **usage,
        "stages": report.get("stages", {}),
        **summary(errors),
        "scans": _by_original(errors, truth),
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


def summary(errors: PoseErrors) -> dict[str, Any]:
    """Counts, and mean and largest errors of the placed scans (None if there are none)."""
    rotations, translations = errors.rotations_deg, errors.translations_percent
    is_empty = not len(rotations)
    return {
        **{str(standing): errors.count(standing) for standing in Standing},
        "rotation_mean": None if is_empty else float(rotations.mean()),
        "rotation_max": None if is_empty else float(rotations.max()),
        "translation_mean": None if is_empty else float(translations.mean()),
        "translation_max": None if is_empty else float(translations.max()),
    }


def table(runs: list[dict[str, Any]]) -> tuple[list[str], bool]:
    """Markdown lines, one a set, and whether every floor is met."""
    headings = ["set", "seeds", "right", "wrong", *(c[1] for c in COLUMNS), "verdicts"]
    lines = ["| " + " | ".join(headings) + " |", "|" + "---|" * len(headings)]
    is_passed = True
    for name in dict.fromkeys(run["set"] for run in runs):
        of_set = [run for run in runs if run["set"] == name]
        cells, is_met = _row(of_set, SETS[name].floors)
        lines.append("| " + " | ".join([name, str(len(of_set)), *cells]) + " |")
        is_passed &= is_met
    return lines, is_passed


def _row(runs: list[dict[str, Any]], floors: Floors) -> tuple[list[str], bool]:
    right, wrong = min(run["right"] for run in runs), max(run["wrong"] for run in runs)
    judged = [
        _judged(f"{right}/{floors.right}", right >= floors.right),
        _judged(str(wrong), wrong == 0),
    ]
    for key, _, together, digits in COLUMNS:
        values = [run[key] for run in runs if run[key] is not None]
        floor = getattr(floors, key, None)
        if not values:
            judged.append(_judged("-", floor is None))
            continue
        value = together(values)
        text = f"{value:.{digits}f}" + (f" ({floor:g})" if floor is not None else "")
        judged.append(_judged(text, floor is None or value <= floor))
    verdicts = " ".join(sorted({run["verdict"] for run in runs}))
    return [text for text, _ in judged] + [verdicts], all(is_met for _, is_met in judged)


def _judged(text: str, is_met: bool) -> tuple[str, bool]:
    return (text if is_met else f"**{text} FAIL**"), is_met


def _executable() -> str:
    """The command that is installed beside this Python, else the one on the path."""
    beside = Path(sys.executable).with_name("scanweld")
    return str(beside) if beside.exists() else "scanweld"


def _outcome(out: Path) -> tuple[PoseSet, dict[str, Any]]:
    """Poses and report of a run; empty where it failed."""
    if not (out / "poses.json").exists():
        return PoseSet(poses={}, components=()), {}
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    return read_poses(out / "poses.json"), report


def _by_original(errors: PoseErrors, truth: Truth) -> dict[str, dict[str, Any]]:
    """Errors under the names that the scans have in the data."""
    return {
        truth.originals[name]: {
            "standing": str(error.standing),
            "rotation_deg": None if error.standing is Standing.UNPLACED else error.rotation_deg,
            "translation_percent": None
            if error.standing is Standing.UNPLACED
            else 100.0 * error.translation / truth.diameter,
        }
        for name, error in sorted(errors.scans.items())
    }


def _keep(out: Path, kept: Path) -> None:
    if out.exists():
        kept.parent.mkdir(parents=True, exist_ok=True)
        subprocess.run(["cp", "-r", str(out), str(kept)], check=True)


def _progress_line(run: dict[str, Any]) -> str:
    counts = ", ".join(f"{run[str(standing)]} {standing}" for standing in Standing)
    return f"{run['set']} seed {run['seed']}: {counts}, {run['verdict']}, {run['seconds']:.1f} s"


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Run the main job on sets of scans.")
    parser.add_argument("--sets", nargs="+", choices=list(SETS), default=list(SETS), metavar="SET")
    parser.add_argument("--seeds", type=int, default=3, help="number of orders, names and frames")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--data", type=Path, help="folder of the Stanford data")
    parser.add_argument("--out", type=Path, help="JSON file of all runs")
    parser.add_argument("--keep", type=Path, help="folder for the models of all runs")
    parser.add_argument("--cold", action="store_true", help="compile anew, as after installation")
    parser.add_argument("extra", nargs="*", help="further options of scanweld run, after --")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
