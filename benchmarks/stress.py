"""Try to make the main job place scans wrongly: named scenarios of virtual scans, by seeds.

    python benchmarks/stress.py --scenarios "ring 8" mirrored --seeds 3 --out stress.json

Every scan comes in a random frame under a neutral name. A scan is *wrong* if it is called good but
not right, or if it is called good where the object's symmetry leaves its pose open. Scans *apart*
are in another than the largest component. Runs in the output file already are not repeated.
"""

import argparse
import sys
import time
import traceback
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from results import read_results, write_results
from scanweld.config import Config, FusionConfig
from scanweld.errors import ScanweldError
from scanweld.evaluation.metrics import PoseErrors, Standing, evaluate_poses
from scanweld.geometry.pose import Pose
from scanweld.io import PoseSet
from scanweld.pipeline import run
from scanweld.reconstruction import Reconstruction, ScanVerdict
from scenarios import FEW, SCENARIOS, Scene, make_scene

CONFIG = Config(fusion=FusionConfig(max_voxels_across=100))
"""The defaults, but for a coarse model: only poses are looked at."""
HEADINGS = (
    *("scenario", "runs", "right %", "wrong", "doubtful", "of these wrong", "unplaced", "apart"),
    *("verdicts", "wall s", "CPU s"),
)


def main() -> int:
    """Run the scenarios; 0 if no scan is wrong and no run crashed, else 1."""
    options = _options()
    runs = _stored(options.out)
    for seed in range(options.first_seed, options.first_seed + options.seeds):
        for name in options.scenarios:
            if any(r["scenario"] == name and r["seed"] == seed for r in runs):
                continue
            runs.append(run_scenario(name, seed, options))
            print(_progress_line(runs[-1]), file=sys.stderr, flush=True)
            if options.out:
                write_results(options.out, runs)
    shown = [r for r in runs if r["scenario"] in options.scenarios]
    print("\n".join(table(shown)))
    return int(any(r["wrong"] or r["verdict"] == "crash" for r in shown))


def run_scenario(name: str, seed: int, options: argparse.Namespace) -> dict[str, Any]:
    """Make the scans, run the main job on them, and evaluate what it asserts."""
    scene = make_scene(name, seed, options.data)
    wall, cpu = time.perf_counter(), time.process_time()
    outcome: dict[str, Any]
    try:
        found = run(scene.scans, CONFIG, workers=options.workers)
        outcome = evaluate(found, scene)
    except ScanweldError as error:
        outcome = _nothing(scene, "error", str(error))
    except Exception:
        # A crash is what this benchmark looks for: it is kept, and the other runs go on.
        outcome = _nothing(scene, "crash", traceback.format_exc())
    seconds = {"seconds": time.perf_counter() - wall, "cpu_seconds": time.process_time() - cpu}
    return {"scenario": name, "seed": seed, **outcome, **seconds}


def evaluate(found: Reconstruction, scene: Scene) -> dict[str, Any]:
    """Counts, and what became of every scan."""
    estimate = PoseSet(poses=dict(found.poses), components=found.components)
    truth = nearest_truth(estimate, scene)
    errors = evaluate_poses(estimate, truth, centroids=scene.centroids, diameter=scene.diameter)
    scans = {name: _scan_outcome(name, found, errors, scene) for name in sorted(scene.sources)}
    return {
        "verdict": str(found.verdict),
        "reasons": list(found.reasons),
        **_counts(scans, scene),
        "scans": scans,
    }


def nearest_truth(estimate: PoseSet, scene: Scene) -> dict[str, Pose]:
    """The true poses; of a symmetric object, the equivalent ones that are nearest the estimate.

    Each component is first moved so that its first scan is right.
    """
    truth = dict(scene.truth)
    if not scene.symmetry:
        return truth
    for component in estimate.components:
        first = component[0]
        world_from_component = truth[first] @ estimate.poses[first].inverse()
        for name in component:
            placed = world_from_component @ estimate.poses[name]
            options = [scene.truth[name], *(g @ scene.truth[name] for g in scene.symmetry)]
            centre = scene.centroids[name]
            turned = [np.linalg.norm(o.rotation - placed.rotation) for o in options]
            shifts = [np.linalg.norm(o.apply(centre) - placed.apply(centre)) for o in options]
            apart = np.array(turned) + np.array(shifts) / scene.diameter
            truth[name] = options[int(np.argmin(apart))]
    return truth


def _scan_outcome(
    name: str, found: Reconstruction, errors: PoseErrors, scene: Scene
) -> dict[str, Any]:
    report, error = found.scans[name], errors.scans.get(name)
    is_known = error is not None and np.isfinite(error.rotation_deg)
    component = next((k for k, c in enumerate(found.components) if name in c), None)
    return {
        "source": scene.sources[name],
        "belongs": name in scene.truth,
        "standing": str(error.standing if error else Standing.UNPLACED),
        "verdict": str(report.verdict),
        "component": component,
        "rotation_deg": error.rotation_deg if error and is_known else None,
        "translation_percent": 100 * error.translation / scene.diameter
        if error and is_known
        else None,
        "overlap": report.overlap,
        "reason": report.reason,
        "notes": list(report.notes),
    }


def _counts(scans: dict[str, dict[str, Any]], scene: Scene) -> dict[str, Any]:
    """Scans by what was made of them; right ones as a share of those that belong."""
    is_open = bool(scene.symmetry)

    def is_false(scan: dict[str, Any]) -> bool:
        return scan["standing"] == Standing.WRONG or (
            is_open and scan["standing"] != Standing.UNPLACED
        )

    placed = list(scans.values())
    doubtful = [s for s in placed if s["verdict"] == ScanVerdict.DOUBTFUL]
    return {
        "belonging": sum(s["belongs"] for s in placed),
        "right": sum(s["standing"] == Standing.RIGHT for s in placed),
        "wrong": sum(is_false(s) and s["verdict"] == ScanVerdict.GOOD for s in placed),
        "wrong_shape": sum(s["standing"] == Standing.WRONG for s in placed),
        "doubtful": len(doubtful),
        "doubtful_wrong": sum(map(is_false, doubtful)),
        "unplaced": sum(s["belongs"] and s["standing"] == Standing.UNPLACED for s in placed),
        "apart": sum(s["component"] not in (0, None) for s in placed),
    }


def _nothing(scene: Scene, verdict: str, reason: str) -> dict[str, Any]:
    zeros = dict.fromkeys(
        ("right", "wrong", "wrong_shape", "doubtful", "doubtful_wrong", "apart"), 0
    )
    belonging = len(scene.truth)
    counts = {"belonging": belonging, **zeros, "unplaced": belonging}
    return {"verdict": verdict, "reasons": [reason], **counts, "scans": {}}


def table(runs: list[dict[str, Any]]) -> list[str]:
    """Markdown lines, one a scenario."""
    lines = ["| " + " | ".join(HEADINGS) + " |", "|" + "---|" * len(HEADINGS)]
    for name in dict.fromkeys(r["scenario"] for r in runs):
        of = [r for r in runs if r["scenario"] == name]
        total = {key: sum(r[key] for r in of) for key in _SUMMED}
        verdicts = [r["verdict"] for r in of]
        told = " ".join(f"{v} {verdicts.count(v)}" for v in dict.fromkeys(verdicts))
        cells = [
            *(name, str(len(of)), f"{100 * total['right'] / max(total['belonging'], 1):.0f}"),
            f"**{total['wrong']}**" if total["wrong"] else "0",
            *(str(total[key]) for key in _SUMMED[3:]),
            *(told, f"{median(r['seconds'] for r in of):.0f}"),
            f"{median(r['cpu_seconds'] for r in of):.0f}",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


_SUMMED = ("belonging", "right", "wrong", "doubtful", "doubtful_wrong", "unplaced", "apart")


def _progress_line(run: dict[str, Any]) -> str:
    counts = ", ".join(f"{run[key]} {key}" for key in _SUMMED[1:] if run[key])
    return f"{run['scenario']}, seed {run['seed']}: {counts}; {run['verdict']}, " + (
        f"{run['seconds']:.0f} s"
    )


def _stored(out: Path | None) -> list[dict[str, Any]]:
    if out is None or not out.exists():
        return []
    return list(read_results(out)["records"])


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--scenarios", nargs="+", choices=SCENARIOS, default=list(SCENARIOS), metavar="NAME"
    )
    parser.add_argument(
        "--few",
        dest="scenarios",
        action="store_const",
        const=list(FEW),
        help="some of each kind: those of docs/benchmarks.md",
    )
    parser.add_argument("--seeds", type=int, default=3, help="how many (default: 3)")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--data", type=Path, help="folder of the Stanford data")
    parser.add_argument("--out", type=Path, help="JSON of all runs; those in it are not repeated")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
