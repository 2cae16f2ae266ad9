"""A cluster changes no byte, nor does a worker that dies; what cannot work is told in a line."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from scanweld.config import Config, FusionConfig, PairsConfig
from scanweld.errors import InputError
from scanweld.pipeline.run import run
from scanweld.reconstruction import Reconstruction
from scanweld.work import cluster as cluster_module
from scanweld.work.cluster import Cluster, VersionError, versions
from scanweld.work.progress import Event, Progress, StageAdvanced, silent
from scanweld.work.runners import Shared, Threads
from tests.command_line import error_line, scanweld
from tests.results import Memory
from tests.scenes import creature_scene

distributed = pytest.importorskip("distributed", reason="needs dask.distributed")
pytestmark = pytest.mark.slow

METHODS = ("robust", "paper")


@contextmanager
def local_cluster(num_workers: int) -> Iterator[Any]:
    """A cluster of processes of this machine."""
    with distributed.LocalCluster(
        n_workers=num_workers, threads_per_worker=1, processes=True, dashboard_address=":0"
    ) as cluster:
        yield cluster


@cache
def scans() -> tuple[Any, ...]:
    return tuple(creature_scene(4, pixels=60.0).scans)


def result_of(
    method: str, workers: Any, progress: Progress = silent, cache: Memory | None = None
) -> Reconstruction:
    pairs = PairsConfig(num_anchors=8, num_turns=8, num_survivors=(40, 10))
    config = Config.model_validate(
        {"method": method, "pairs": pairs, "fusion": FusionConfig(max_voxels_across=60)}
    )
    return run(scans(), config, workers=workers, progress=progress, cache=cache)


@cache
def by_threads(method: str) -> tuple[Any, ...]:
    return told(result_of(method, 2))


def told(result: Reconstruction) -> tuple[Any, ...]:
    """All of a result but its times."""
    mesh = result.mesh
    return (
        {name: pose.matrix().tobytes() for name, pose in result.poses.items()},
        None if mesh is None else (mesh.vertices.tobytes(), mesh.faces.tobytes()),
        repr(result.scans),
        repr([(pair.i, pair.j, pair.reason, pair.score, pair.margin) for pair in result.pairs]),
    )


@pytest.mark.parametrize("num_workers", [1, 2, 4])
def test_any_number_of_workers_gives_the_same_bytes(num_workers: int):
    with local_cluster(num_workers) as local, Cluster(local.scheduler_address) as cluster:
        for method in METHODS if num_workers == 2 else METHODS[:1]:
            memory = Memory()
            assert told(result_of(method, cluster, cache=memory)) == by_threads(method)
            kept = memory.num_put
            assert kept >= 10  # by us, not by the cluster
            assert told(result_of(method, 1, cache=memory)) == by_threads(method)
            assert memory.num_put == kept


@pytest.mark.parametrize("num_workers", [1, 2])
def test_a_worker_that_is_killed_costs_time_only(num_workers: int):
    with local_cluster(num_workers) as local, Cluster(local.scheduler_address) as cluster:
        killed: list[int] = []

        def kill(event: Event) -> None:
            stages = ("prepare", "pairs", "search")
            if isinstance(event, StageAdvanced) and event.stage in stages[len(killed) :][:1]:
                killed.append(local.workers[0].pid)
                os.kill(killed[-1], signal.SIGKILL)

        assert told(result_of("robust", cluster, kill)) == by_threads("robust")
        assert len(set(killed)) >= 2


def add(item: int, *parts: int) -> int:
    return item + sum(parts)


def fails(item: int) -> int:
    raise ZeroDivisionError(f"a bug in {item}")


def test_results_come_in_the_items_order_and_each_part_is_sent_once():
    items = list(range(20))
    shared: Shared[int] = Shared(
        parts={0: 100, 1: 1000, 2: 1000},
        names={0: "hundred", 1: "thousand", 2: "thousand"},
        of=lambda item: (item % 2, 2),
    )
    with local_cluster(2) as local, Cluster(local.scheduler_address) as cluster:
        for given in (None, shared):
            expected = list(Threads(workers=2).map(add, items, given))
            assert list(cluster.map(add, items, given)) == expected
        assert expected[:2] == [1100, 2001]
        held = local.scheduler_info["workers"]
        assert len(held) == 2 and len(cluster._parts) == 2
        with pytest.raises(ZeroDivisionError, match="a bug in 7"):
            list(cluster.map(fails, [7]))
        assert list(cluster.map(add, [1])) == [1]


def test_a_cluster_without_workers_is_not_waited_for_for_ever(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(cluster_module, "WAIT_SECONDS", 2)
    with local_cluster(1) as local, Cluster(local.scheduler_address) as cluster:
        assert list(cluster.map(add, [1])) == [1]
        local.scale(0)
        with pytest.raises(InputError, match="all workers of the cluster are gone; start some by"):
            list(cluster.map(add, [2]))


def test_workers_that_are_not_like_us_are_refused(monkeypatch: pytest.MonkeyPatch):
    with local_cluster(1) as local:
        with Cluster(local.scheduler_address) as cluster:
            monkeypatch.setattr(cluster_module, "code_digest", lambda: "another")
            versions.cache_clear()
            with pytest.raises(VersionError, match=r"scanweld's code [0-9a-f]+, not another"):
                list(cluster.map(add, [1]))
        with pytest.raises(VersionError, match=r"scanweld's code [0-9a-f]+, not another"):
            Cluster(local.scheduler_address)
    versions.cache_clear()
    monkeypatch.undo()
    with local_cluster(0) as local, pytest.raises(InputError, match="no workers"):
        Cluster(local.scheduler_address)


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://a", "no such host:1"])
def test_a_scheduler_that_is_not_there_is_told_in_a_line(
    address: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    monkeypatch.setattr(cluster_module, "CONNECT_SECONDS", 1)
    (tmp_path / "a.ply").write_text("never read")
    output = tmp_path / "model"
    assert scanweld("run", tmp_path / "a.ply", "-o", output, "--scheduler", address, "-q") == 1
    assert f"{address}: no scheduler can be reached" in error_line(capsys)
    assert [path.name for path in tmp_path.iterdir()] == ["a.ply"]


def test_without_dask_a_line_says_how_to_get_it(tmp_path: Path):
    program = (
        "import sys; sys.modules['distributed'] = None\n"
        "from scanweld.app.cli import main\n"
        "main(['run', 'a.ply', '-o', 'model', '--scheduler', 'tcp://127.0.0.1:1', '-q'])\n"
    )
    (tmp_path / "a.ply").write_text("never read")
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert "pip install 'scanweld[cluster]'" in line
