"""Scans -> reconstruction: the one entry to both methods."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from scanweld.config import Config
from scanweld.geometry.scan import RangeScan
from scanweld.knowledge.facts import Knowledge
from scanweld.pipeline.conclude import conclude
from scanweld.pipeline.intake import Intake, take_in
from scanweld.pipeline.method import Scene
from scanweld.pipeline.object_cut import cut_scans, with_kept
from scanweld.pipeline.published import published_method
from scanweld.pipeline.registration import common_axis, register_pairs
from scanweld.pipeline.robust import robust_method
from scanweld.pipeline.sensing import as_silhouettes_allow, learnt
from scanweld.pipeline.stages import (
    assess_placed,
    check_knowledge,
    fuse_largest,
    lay_out,
    place_scans,
    preview_largest,
    refine_placed,
)
from scanweld.reconstruction import Reconstruction
from scanweld.work.progress import Cache, NoCache, Progress, silent
from scanweld.work.runners import Runner
from scanweld.work.stage_log import Stages
from scanweld.work.threads import num_workers, single_threaded_algebra

PREVIEWED = "preview.ply shows how the doubtful scans lie; it is no model"
METHODS = {"robust": robust_method, "paper": published_method}
"""By their names in the settings: from the scans of a run to the steps of a method."""


def run(
    scans: Sequence[RangeScan],
    config: Config | None = None,
    *,
    knowledge: Knowledge | None = None,
    unreadable: Mapping[str, str] | None = None,
    workers: int | Runner | None = None,
    cache: Cache | None = None,
    progress: Progress = silent,
) -> Reconstruction:
    """Register unordered scans, fuse them into one mesh and say how good both are.

    Args:
        scans: Scans of one rigid object in arbitrary frames, in any order, names unique.
        config: Settings of every stage; the defaults if not given.
        knowledge: What is known beforehand; each fact is checked and reported.
        unreadable: Name -> reason of scans that could not even be read, for the report.
        workers: Threads over scans and pairs, as many as there are cores if not given; or who else
            carries that out, such as a cluster.
        cache: Keeps finished work: what an earlier run has done, whole or not, is not done again.
        progress: Told of stages, their finished items, and scans that are refused.

    Returns:
        The poses of the scans that could be placed, the mesh, and the report. Scans that could
        not be placed are named in it with the reason.

    Raises:
        InputError: If fewer than two scans are usable, or the settings ask for what moves and
            nothing does.
        KnowledgeError: If what is known is about scans that are not there.
    """
    config = config or Config()
    runner = None if isinstance(workers, int) else workers
    stages = Stages(
        workers=num_workers(workers if isinstance(workers, int) else None),
        cache=cache or NoCache(),
        progress=progress,
        runner=runner,
    )
    with single_threaded_algebra():
        known = knowledge or Knowledge()
        cut = cut_scans(scans, known.start, config, stages)
        refused = {**(unreadable or {}), **cut.empty}
        intake = take_in(cut.scans, refused, known, config, stages)
        return with_kept(reconstruct(intake, config, stages), cut)


def reconstruct(intake: Intake, config: Config, stages: Stages) -> Reconstruction:
    """Register the scans of a run, fuse them and judge what came out, by the method asked for.

    Args:
        intake: The scans, prepared, and what users know of them.
        config: Settings of every stage.
        stages: Bookkeeping of the run.
    """
    scene = Scene(intake=intake, judge=lay_out(intake, config, stages))
    method = METHODS[config.method](scene, config, stages.workers)
    registered = register_pairs(scene, method, config, stages)
    registered = as_silhouettes_allow(registered, method, config, stages)
    registered = learnt(registered, config, stages)
    scene = registered.scene
    axis = common_axis(scene, registered.pairs, config)
    graph = place_scans(registered, axis, method, config, stages)
    graph = refine_placed(scene, graph, axis, method, config, stages)
    graph, confidence = assess_placed(scene, graph, config, stages)
    mesh = fuse_largest(intake, graph, config, stages)
    preview = preview_largest(intake, graph, config, stages)
    facts = check_knowledge(scene, graph, axis)
    result = conclude(scene, graph, confidence, mesh, facts, config, stages.reports)
    if preview is None:
        return result
    return replace(result, preview=preview, reasons=(*result.reasons, PREVIEWED))
