"""The object, cut out of whole depth frames before anything else is done."""

from collections.abc import Sequence
from dataclasses import replace

from scanweld.config import Config
from scanweld.cut import CutSet, Stood, camera_of, cut_out, mask_text
from scanweld.geometry.scan import RangeScan
from scanweld.io import PoseSet
from scanweld.reconstruction import Reconstruction
from scanweld.work.progress import ScanRefused
from scanweld.work.stage_log import Stages


def cut_scans(
    scans: Sequence[RangeScan], start: PoseSet | None, config: Config, stages: Stages
) -> CutSet:
    """Cut the object out of a run's scans, if they are whole frames.

    Args:
        scans: Of the run.
        start: Where a camera that moved stood, if that is known.
        config: Settings of every stage.
        stages: Bookkeeping of the run.

    Raises:
        InputError: If what moves is asked for, and nothing does.
    """
    if config.object == "all" or camera_of(scans) is None:
        return cut_out(scans, config.object)
    with stages.stage("cut") as counts:
        stood = start and Stood(poses=start.poses, components=start.components)
        cut = cut_out(scans, config.object, stood)
        counts["cut"] = len(cut.kept)
    for name, reason in cut.empty.items():
        stages.progress(ScanRefused(scan=name, reason=reason))
    return cut


def with_kept(result: Reconstruction, cut: CutSet) -> Reconstruction:
    """A run's result that knows what was cut off its scans."""
    scans = {
        name: replace(scan, kept=mask_text(cut.kept[name])) if name in cut.kept else scan
        for name, scan in result.scans.items()
    }
    return replace(result, scans=scans)
