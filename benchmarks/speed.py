"""How fast the main job is: CPU seconds of stages and runs, beside a fixed loop and Open3D.

    python -m benchmarks.speed                        all of it, and the page docs/performance.md
    python -m benchmarks.speed --parts many --many 10 20 40
    python -m benchmarks.speed --quick --out DIR      small, without the data
    python -m benchmarks.speed --pages                the page anew, from the JSON that stands

Parts that are measured replace those that stand in data/speed.json. CPU seconds are user and system
time of ``scanweld run`` as a process, of a stage those between its two events.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from statistics import mean, median, median_low
from typing import Any

import numpy as np

from benchmarks.blocks import rendered
from benchmarks.clear import ClearPairs, over_limits
from benchmarks.kept import COLLECTED, add_options, measured, study
from benchmarks.results import Json, how_measured, read_results, write_file, write_results
from benchmarks.run import evaluated, scanweld_command, timed
from benchmarks.sets import SETS, Truth, data_folder, make_set, truth_of
from benchmarks.study.plots import GRID, save, subplots
from scanweld.evaluation.metrics import Standing
from scanweld.evaluation.simulate import simulate
from scanweld.geometry.pose import Pose
from scanweld.io import PoseSet, read_mesh, read_poses, read_scan

MEASURED, RIVAL_SET = ("bunny10", "dragon15", "demo"), "bunny10"
MANY, PIXELS, FIRST_OF_LARGE = (10, 20, 40, 80, 200), 300.0, 40
"""Numbers of virtual scans, their pixels, and from how many on the exponents of stages are."""
ONE_MORE = (10, 40)
"""Numbers of scans that are done when one more comes."""
NUM_LOOPS = 320
"""About one CPU second at 2.4 GHz."""
NUM_SMALL = 5
CLEAR_CODE = (*COLLECTED, "benchmarks/clear.py")
AFTER_POSES = ("fuse", "report", "rest")
FLOORS = {
    **{"bunny10": 12.0, "dragon15": 16.0, "40": 60.0, "200": 600.0, "exponent": 1.3},
    **{"open3d": 8.0, "share": 0.6, "peak_mb": 3072.0, "help": 0.3, "info": 0.8, "first": 10.0},
    **{"more10": 0.25, "more40": 0.1},
}
"""In CPU seconds, of the first run and small commands in seconds of wall time."""


def main() -> int:
    """Measure the parts that are asked for, and write the page."""
    parts: dict[str, Callable[[argparse.Namespace], Iterable[Json]]] = {
        **{"clear": clear, "small": small, "first": first, "sets": sets, "many": many},
        **{"more": more},
    }
    parser = argparse.ArgumentParser(prog="python -m benchmarks.speed", description=__doc__)
    add = add_options(parser, "--jobs", "speed").add_argument
    add("--parts", nargs="+", choices=parts, default=tuple(parts), metavar="PART")
    add("--many", nargs="+", type=int, default=MANY, metavar="N", help="numbers of virtual scans")
    add("--runs", type=int, default=3, help="of each set; the median stands")
    add("--data", type=Path, help="folder of the Stanford data")
    add("--pages", action="store_true", help="only write the page anew")
    options = parser.parse_args()
    path = options.out / "data/speed.json"
    for part in () if options.pages else options.parts:
        for record in parts[part](options):
            print(json.dumps(record), file=sys.stderr, flush=True)
            known = read_results(path)["records"] if path.exists() else []
            kept = [r for r in known if (r["kind"], r["name"]) != (record["kind"], record["name"])]
            write_results(path, [*kept, record])
    document = read_results(path)
    write_file(options.out / "performance.md", page(document))
    plot(document["records"], options.out / "performance.png")
    return 0


def loop() -> float:
    """CPU seconds of a fixed loop: look-ups in a table of 512 KB, roots and sorting."""
    table, order = np.linspace(0.0, 1.0, 1 << 16), np.random.default_rng(0).permutation(1 << 16)
    start = time.process_time()
    for _ in range(NUM_LOOPS):
        np.sort(np.sqrt(table[order] * table + 1.0))
    return time.process_time() - start


def beside_loop(measure: Callable[[], Json]) -> Json:
    """What is measured, with the CPU seconds of the fixed loop about it."""
    before = loop()
    found = measure()
    return {**found, "loop": mean((before, loop())), "load": os.getloadavg()[0]}


def run_once(
    folder: Path, truth: Truth, workers: int = 1, out: Path | None = None, **environment: str
) -> Json:
    """Run the main job on a folder of scans: CPU of its stages, memory, counts and errors."""
    with tempfile.TemporaryDirectory(prefix="scanweld-") as temporary:
        out = out or Path(temporary) / "model"
        command = scanweld_command("run", folder, "-o", out, "--workers", workers, "--json")
        start = time.perf_counter()
        process = subprocess.Popen(
            command, env={**os.environ, **environment}, stdout=subprocess.PIPE, text=True
        )
        assert process.stdout is not None
        stages: dict[str, float] = {}
        counts: dict[str, float] = {}
        begun, poses_mb = 0.0, 0.0
        for event in map(json.loads, process.stdout):
            cpu, peak_mb = _spent(process.pid)
            if event["event"] == "stage_started":
                stages.setdefault("start", cpu)
                begun = cpu
                poses_mb = peak_mb if event["stage"] == "fuse" else poses_mb
            elif event["event"] == "stage_finished":
                stage = event["stage"]
                stages[stage] = stages.get(stage, 0.0) + cpu - begun
                counts[stage] = event["counts"].get("pairs", 0)
        _, _, usage = os.wait4(process.pid, 0)
        seconds, cpu = time.perf_counter() - start, usage.ru_utime + usage.ru_stime
        found = read_poses(out / "poses.json")
        verdict = json.loads((out / "report.json").read_text(encoding="utf-8"))["verdict"]
    stages["rest"] = cpu - sum(stages.values())
    return {
        **{"scans": len(truth.poses), "cpu": cpu, "seconds": seconds, "stages": stages},
        "poses": sum(s for name, s in stages.items() if name not in AFTER_POSES),
        **{"poses_mb": poses_mb, "peak_mb": usage.ru_maxrss / 1024.0, "verdict": verdict},
        **{"quick": counts.get("pairs", 0), "thorough": counts.get("search", 0)},
        **_standings(found, truth),
    }


def _spent(pid: int) -> tuple[float, float]:
    """CPU seconds and peak megabytes of a process so far, as Linux tells."""
    process = Path(f"/proc/{pid}")
    ticks = process.joinpath("stat").read_text().rpartition(")")[2].split()[11:13]
    told = dict(line.split(":", 1) for line in process.joinpath("status").read_text().splitlines())
    peak_kb = float(told.get("VmHWM", "0 kB").split()[0])
    return sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK"), peak_kb / 1024.0


def _standings(found: PoseSet, truth: Truth) -> Json:
    errors = evaluated(found, truth)
    return {str(s): errors.count(s) for s in (Standing.RIGHT, Standing.WRONG)}


def sets(options: argparse.Namespace) -> Iterator[Json]:
    """Whole runs, by one and by two threads, and Open3D in turn with them on one set."""
    for name in ["quick"] if options.quick else MEASURED:
        yield from _set(name, options)


def _set(name: str, options: argparse.Namespace) -> list[Json]:
    with tempfile.TemporaryDirectory(prefix="scanweld-") as temporary:
        folder = Path(temporary) / "scans"
        truth = make_set(SETS[name], 0, folder, data_folder(options.data))
        runs, rivals = [], []
        for _ in range(1 if options.quick else options.runs):
            runs.append(_measured(folder, truth))
            if name == RIVAL_SET:
                rivals.append(beside_loop(lambda: open3d_once(folder, truth)))
        two = _measured(folder, truth, 2)
    ours = {"kind": "set", "name": name, **_median(runs), "two_workers": _brief(two)}
    return [ours, *({"kind": "open3d", "name": name, **_median(rivals)} for _ in rivals[:1])]


def _median(runs: Sequence[Json]) -> Json:
    """The run whose CPU is the median, and the least and the most, all in loops."""
    ratios = [run["cpu"] / run["loop"] for run in runs if "cpu" in run]
    if not ratios:
        return runs[0]
    return {**runs[ratios.index(median_low(ratios))], "range": [min(ratios), max(ratios)]}


def many(options: argparse.Namespace) -> Iterator[Json]:
    """More and more virtual scans of one object."""
    for number in () if options.quick else options.many:
        mesh = read_mesh(data_folder(options.data) / "meshes/armadillo.ply")
        with tempfile.TemporaryDirectory(prefix="scanweld-") as temporary:
            folder = Path(temporary) / "scans"
            poses = simulate(mesh, folder, num_scans=number, pixels=PIXELS).poses
            scans = [read_scan(path) for path in sorted(folder.glob("*.ply"))]
            yield {"kind": "many", "name": str(number), **_measured(folder, truth_of(scans, poses))}


def more(options: argparse.Namespace) -> Iterator[Json]:
    """One more scan to some that are done, beside all of them at once."""
    for number in () if options.quick else ONE_MORE:
        mesh = read_mesh(data_folder(options.data) / "meshes/armadillo.ply")
        with tempfile.TemporaryDirectory(prefix="scanweld-") as temporary:
            folder, few, out = (Path(temporary) / name for name in ("scans", "few", "out"))
            poses = simulate(mesh, folder, num_scans=number + 1, pixels=PIXELS).poses
            paths = sorted(folder.glob("*.ply"))
            scans = [read_scan(path) for path in paths]
            few.mkdir()
            for path in paths[:-1]:
                shutil.copy(path, few)
            whole = _measured(folder, truth_of(scans, poses))
            first = {scan.name: poses[scan.name] for scan in scans[:-1]}
            _measured(few, truth_of(scans[:-1], first), 1, out / "few")
            added = _measured(folder, truth_of(scans, poses), 1, out / "more")
            told = {key: _brief(run) for key, run in (("whole", whole), ("added", added))}
            yield {"kind": "more", "name": str(number), **told, "stages": added["stages"]}


def _measured(folder: Path, truth: Truth, *how: Any, **environment: str) -> Json:
    return beside_loop(lambda: run_once(folder, truth, *how, **environment))


def first(options: argparse.Namespace) -> list[Json]:
    """The first run after installation, into an empty cache of kernels, beside the next one."""
    name = "quick" if options.quick else "demo"
    with tempfile.TemporaryDirectory(prefix="scanweld-") as temporary:
        folder, cache = Path(temporary) / "scans", str(Path(temporary) / "kernels")
        truth = make_set(SETS[name], 0, folder, data_folder(options.data))
        cold, warm = (_measured(folder, truth, 2, NUMBA_CACHE_DIR=cache) for _ in range(2))
    return [{"kind": "first", "name": name, "cold": _brief(cold), "warm": _brief(warm)}]


def _brief(run: Json) -> Json:
    return {key: run[key] for key in ("cpu", "seconds", "load")}


def small(options: argparse.Namespace) -> list[Json]:
    """Wall time of commands that do next to nothing."""
    records = []
    with tempfile.TemporaryDirectory(prefix="scanweld-") as temporary:
        name = "quick" if options.quick else RIVAL_SET
        make_set(SETS[name], 0, Path(temporary), data_folder(options.data))
        one = next(iter(sorted(Path(temporary).glob("*.ply"))))
        for name, words in {"help": ("--help",), "info": ("info", one)}.items():
            runs = [
                timed(scanweld_command(*words), dict(os.environ)) for _ in range(NUM_SMALL + 1)
            ][1:]
            told = {key: median(run[key] for run in runs) for key in ("seconds", "cpu_seconds")}
            told["load"] = os.getloadavg()[0]
            records.append({"kind": "small", "name": name, **told})
    return records


def clear(options: argparse.Namespace) -> list[Json]:
    """Quick searches against thorough ones on the pairs of the calibration's sets."""
    found = measured(ClearPairs(), study(options, "speed", CLEAR_CODE))
    return [{"name": "calibration", **over_limits(found)}]


def open3d_once(folder: Path, truth: Truth) -> Json:
    """Open3D's multiway registration in a process of its own, on one thread."""
    with tempfile.TemporaryDirectory(prefix="scanweld-") as temporary:
        out = Path(temporary) / "told.json"
        command = [sys.executable, "-m", "benchmarks.multiway", str(folder), str(out)]
        timed(command, {**os.environ, "OMP_NUM_THREADS": "1"})
        told = json.loads(out.read_text(encoding="utf-8"))
    if "poses" not in told:
        return told
    poses = {name: Pose.from_matrix(np.array(rows)) for name, rows in told.pop("poses").items()}
    return {**told, **_standings(PoseSet(poses=poses, components=(tuple(poses),)), truth)}


def exponents(records: Sequence[Json]) -> dict[str, float]:
    """With what power of the number of scans the CPU seconds grow: of stages from many on."""
    large = [record for record in records if record["scans"] >= FIRST_OF_LARGE]
    stages = list(dict.fromkeys(name for record in large for name in record["stages"]))
    found = {name: _slope(large, lambda r, n=name: r["stages"].get(n, 0.0)) for name in stages}
    found["poses"] = _slope(large, lambda record: record["poses"])
    found["whole"] = _slope(large, lambda record: record["cpu"])
    found["all"] = _slope(records, lambda record: record["cpu"])
    found["pairs searched"] = _slope(large, lambda record: record["quick"] * record["loop"])
    return {name: slope for name, slope in found.items() if np.isfinite(slope)}


def _slope(records: Sequence[Json], cost: Callable[[Json], float]) -> float:
    if len(records) < 2 or min(map(cost, records)) <= 0:
        return np.nan
    scans = np.log([record["scans"] for record in records])
    return float(np.polyfit(scans, np.log([cost(r) / r["loop"] for r in records]), 1)[0])


def page(document: Json) -> str:
    """The whole page; what was not measured is left out."""
    kinds = {"set", "open3d", "many", "first", "small", "clear", "more"}
    of = {kind: [r for r in document["records"] if r["kind"] == kind] for kind in kinds}
    of["many"].sort(key=lambda record: record["scans"])
    stages = list(dict.fromkeys(s for r in (*of["set"], *of["many"]) for s in r["stages"]))
    return rendered(
        "speed",
        **{"how": how_measured(document), "of": of, "stages": stages, "floors": FLOORS},
        exponents=exponents(of["many"]),
    )


def plot(records: Sequence[Json], path: Path) -> None:
    """CPU of the stages against the number of scans."""
    virtual = sorted((r for r in records if r["kind"] == "many"), key=lambda r: r["scans"])
    if not virtual:
        return
    figure, axes = subplots(figsize=(7, 4.6))
    numbers = [record["scans"] for record in virtual]
    for name in dict.fromkeys(stage for record in virtual for stage in record["stages"]):
        costs = [max(r["stages"].get(name, 0.0), 1e-3) / r["loop"] for r in virtual]
        axes.loglog(numbers, costs, marker="o", markersize=3, lw=1, label=name)
    axes.loglog(numbers, [r["cpu"] / r["loop"] for r in virtual], "k-o", lw=2.5, label="whole")
    axes.set(xlabel="virtual scans", ylabel="CPU, in fixed loops", ylim=(0.05, None))
    axes.set_xticks(numbers, [str(number) for number in numbers], minor=False)
    axes.grid(**GRID)
    axes.legend(bbox_to_anchor=(1.02, 1.0), loc="upper left", frameon=False, fontsize=8)
    save(figure, path, metadata={"Software": None})


if __name__ == "__main__":
    sys.exit(main())
