"""The first run after installation: other processes compile kernels before the run needs them.

Compiling holds the interpreter's lock, so threads would gain nothing. The others begin with what a
run needs last, and the run itself compiles what it comes to and does not find: they meet midway.
"""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from scanweld.work.progress import Event, Progress, StageStarted
from scanweld.work.threads import num_workers

MAX_PROCESSES = 4
"""Processes that compile, the run among them: more would wait for the longest of the kernels."""
SECONDS_A_KERNEL = 0.6
"""CPU time to compile one, of about 2.4 GHz."""

KERNELS = {
    "io.text._simple_numbers": "u1r1",
    "io.ply_body._find_lists": "u1r1 i8 i8 i8w2 b1",
    "io.ply_body._octets_of_lists": "u1r1 i8w1 i8w1",
    "preparation.resolution._nearest_on_line": "f8w2 f8w1 i8w1",
    "geometry.buckets.into_buckets": "f8w2 f8",
    "geometry.buckets.are_beside": "f8w2 i8w1 i8w1 f8 i8",
    "geometry.grid._find_faces": "i4r2 f8w2 f8w1 f8 f8 i8w2",
    "geometry.rasterize._fill": "f8w2 f8w1 i8w2 b1 f8w2 i8w2",
    "preparation.denoise._fit_planes": "f8w2 i8 f8 f8",
    "geometry.mesh.connected": "i8w1 i8w1 i8",
    "geometry.mesh._normals": "f8w2 i8w2 i8",
    "geometry.mesh.corners_at": "i8w2 i8",
    "geometry.mesh._opposite_edges": "i8w2 i8w1 i8w1",
    "preparation.sampling._farthest": "f8w2 i8 i8 f8",
    "pairs.hypothesis_scores.score_all": "f4w3 f4w1 f4w3 f4w3 f4w4 f4w2 f4w3 f4w1 f4w3 f4w3 "
    "f4w4 f4w2 f4w1 f8w2 f4 f4w3",
    "pairs.distinct.distinct_poses": "f8w2 f8w1 f8 f8 i8",
    "evidence.icp._refine_all": "f8w2 f8w2 f8w2 i4w3 f8w1 f8w2 f8w2 f8w2 i4w3 f8w1 f8w2 f8w1 i8 "
    "f8w1 f8",
    "evidence.visibility.count_evidence": "f8w1 f4w3 f8w2 f8w2 f8w1 f4w3 f8w2 f8w2 f8w2 i8 f8",
    "evidence.sample_patches._largest_patches": "f8w1 f4w3 f8w2 f8w2 i4w2 f8w2 f8 f8",
    "refinement.surface_terms._closest_planes": "f8w2 f8w2 f8r2 f8w1 f8r2 f8 f8r3 b1w2 f8 f8w2 "
    "f8w1",
    "geometry.gauss_newton._jacobian": "f8w2 f8w2 f8w1 f8 f8w2",
    "contours.contour_sets._near_side": "f8w2 b1w2 f8",
    "fusion.sampling._sample": "f8w2 f8w2 f8 f8w2 f8w1 f4w2 f4w3 f4w2 b1w2 f4w1 f4w1",
    "fusion.integrate._near_surface": "f8w1 f4w2 f4w3 f4w2 f8w2 f8w1",
    "fusion.integrate._tile_ends": "f8w1 f4w2 f4w3 f4w2 f8",
    "fusion.integrate._tile_ends_of_free": "b1w2",
    "fusion.integrate._integrate_image": "f4w4 f4w4 f4w4 i8w2 f8w1 f8w2 f8w1 f4w2 f4w3 f4w2 b1w2 "
    "f8 f4w2 f8w1 b1w2 f8 f4w2",
    "fusion.volume._fill_pinholes": "f4w4 f4w4 i8w2 f8 f4w4",
    "fusion.surface._count": "f4w4 i8w2 i8w1",
    "fusion.surface._march": "f4w4 i8w2 i8w2 i8r2 i8w2 i8 i8",
    "fusion.finish._is_back_to_back": "i8w2 i8w1 i8w1",
    "fusion.sheets._find_opposite": "f8w2 f8w2 i8w1 i8w1",
    "fusion.sheets._hang_together": "i8w1 i8w1 i8w2 i8w1 i8w1",
    "fusion.sampling._sample_colors": "f8w2 f8w1 u1w3 f4w2 b1w2 f4w2 f4w1",
    "geometry.shading._shade": "i8w2 f8w2 i8w2 f8w1 b1 u1w2 f8w1 f8w1 f8w3 i8w2",
}
"""What a usual run calls, in the order of its first calls, and with what (see ``types_of``)."""

VIDEO_KERNELS = {
    "video.levels._halved": "f8w2 f8 f8w1",
    "video.levels._planes": "f8w2 f8w1 i8 f8 f8w1",
    "video.match.settle": "f8w2 f8w3 f8w1 f8w1 f8w1 f8w1 f8w1 f8w1 f8 f8 i4w2 f8w2 f8w2",
    "video.average._add": "f8w2 f8w3 f8w1 f8w1 f8w1 f8 f8w2 f8w2 i4w2 i4w2",
}
"""What the run of a video calls before all others."""
WORKING_STAGES = ("video", "prepare")
"""The first in which kernels are called."""


def missing_kernels(*, of_video: bool = False) -> list[str]:
    """Those of the kernels that have not been compiled yet, in the order of their first calls."""
    from scanweld.compiled.kernels import kept_names

    kept = kept_names()
    called = [*VIDEO_KERNELS, *KERNELS] if of_video else [*KERNELS]
    return [name for name in called if ".".join(name.split(".")[-2:]) not in kept]


@contextmanager
def compiling_ahead(
    tell: Callable[[str], object], workers: int | None = None, *, of_video: bool = False
) -> Iterator[Callable[[Progress], Progress]]:
    """Let other processes compile what is missing, from when scans are worked on.

    By then what cannot be meant has been refused, in one line.

    Args:
        tell: Called with a line on it, if anything is missing.
        workers: Processes, this one among them; as many as there are cores if None.
        of_video: Whether the run is of a video.

    Yields:
        What makes the progress of a run start it; processes end with the context.
    """
    others: list[subprocess.Popen[bytes]] = []

    def starting(progress: Progress) -> Progress:
        waits = True

        def told(event: Event) -> None:
            nonlocal waits
            if waits and isinstance(event, StageStarted) and event.stage in WORKING_STAGES:
                waits = False
                others.extend(_start_all(tell, workers, missing_kernels(of_video=of_video)))
            progress(event)

        return told

    try:
        yield starting
    finally:
        for process in others:
            process.terminate()
            process.wait()


def _start_all(
    tell: Callable[[str], object], workers: int | None, missing: Sequence[str]
) -> list[subprocess.Popen[bytes]]:
    """The other processes, each with its part of what is missing; the last first."""
    if not missing or os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        return []
    count = min(num_workers(workers), MAX_PROCESSES)
    seconds = SECONDS_A_KERNEL * len(missing) / count
    what = "1 kernel is" if len(missing) == 1 else f"{len(missing)} kernels are"
    tell(f"first run: {what} compiled, once; that takes some {seconds:.0f} s")
    return [_start(missing[::-1][k :: count - 1]) for k in range(count - 1)]


def _start(names: Sequence[str]) -> subprocess.Popen[bytes]:
    # A session of its own, else it would have its say when a run is interrupted at the keyboard.
    return subprocess.Popen(
        [sys.executable, "-m", "scanweld.app.first_run", *names],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def kernel(name: str) -> Any:
    """A compiled function, by its name in the table."""
    module, _, function = name.rpartition(".")
    return getattr(import_module(f"scanweld.{module}"), function)


def argument_types(name: str) -> tuple[Any, ...]:
    """The types of a kernel's arguments, by its name in the table."""
    from scanweld.compiled.kernels import types_of

    return types_of({**VIDEO_KERNELS, **KERNELS}[name])


def main(names: Sequence[str]) -> None:
    """Compile kernels, one after the other, into the folder where they are kept."""
    for name in names:
        kernel(name).compile(argument_types(name))


if __name__ == "__main__":
    main(sys.argv[1:])
