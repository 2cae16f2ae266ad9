"""Scans -> reconstruction: the one entry to both methods."""

from collections.abc import Mapping, Sequence

from scanweld.config import Config
from scanweld.geometry.scan import RangeScan
from scanweld.knowledge.facts import Knowledge
from scanweld.pipeline.intake import take_in
from scanweld.pipeline.published import reconstruct_as_published
from scanweld.pipeline.robust import reconstruct
from scanweld.reconstruction import Reconstruction
from scanweld.work.progress import Cache, NoCache, Progress, silent
from scanweld.work.stage_log import Stages
from scanweld.work.threads import num_workers, single_threaded_algebra


def run(
    scans: Sequence[RangeScan],
    config: Config | None = None,
    *,
    knowledge: Knowledge | None = None,
    unreadable: Mapping[str, str] | None = None,
    workers: int | None = None,
    cache: Cache | None = None,
    progress: Progress = silent,
) -> Reconstruction:
    """Register unordered scans, fuse them into one mesh and say how good both are.

    Args:
        scans: Scans of one rigid object in arbitrary frames, in any order, names unique.
        config: Settings of every stage; the defaults if not given.
        knowledge: What is known beforehand; each fact is checked and reported.
        unreadable: Name -> reason of scans that could not even be read, for the report.
        workers: Threads over scans and pairs; as many as there are cores if not given.
        cache: Keeps finished work, so that an interrupted run goes on where it stopped.
        progress: Told of stages, their finished items, and scans that are refused.

    Returns:
        The poses of the scans that could be placed, the mesh, and the report. Scans that could
        not be placed are named in it with the reason.

    Raises:
        InputError: If fewer than two scans are usable.
        KnowledgeError: If what is known is about scans that are not there.
    """
    config = config or Config()
    stages = Stages(workers=num_workers(workers), cache=cache or NoCache(), progress=progress)
    with single_threaded_algebra():
        intake = take_in(scans, unreadable or {}, knowledge or Knowledge(), config, stages)
        if config.method == "paper":
            return reconstruct_as_published(intake, config, stages)
        return reconstruct(intake, config, stages)
