"""report.html into a model folder."""

import logging
from collections.abc import Mapping
from pathlib import Path

from pydantic import ValidationError

from scanweld.app.html_report.page import report_page
from scanweld.app.html_report.sources import Sources
from scanweld.app.model_folder import ModelFolder, open_model
from scanweld.config import Config
from scanweld.errors import ReadError
from scanweld.geometry.scan import RangeScan
from scanweld.io import write_whole
from scanweld.reconstruction import Reconstruction
from scanweld.work.threads import single_threaded_algebra

logger = logging.getLogger(__name__)


def write_html_report(
    folder: Path,
    scans: Mapping[str, RangeScan] | None = None,
    result: Reconstruction | None = None,
    workers: int = 1,
) -> Path:
    """Write report.html beside the files that a run wrote: the same files give the same bytes.

    Args:
        folder: The model folder.
        scans: The scans by name, as the model was made of. Without them the page has no residuals,
            support and contours.
        result: What the folder was written from, if that is at hand: then the model is not read
            and no scan is prepared again. The page is the same.
        workers: Threads; the page is the same for any number.

    Returns:
        Path of the page.

    Raises:
        ReadError: If a part of the folder is missing or broken.
        WriteError: If the page cannot be written.
    """
    model = open_model(folder, result)
    _check_whole(model)
    config = _settings(model)
    sources = None
    if scans is not None and model.poses.poses:
        sources = Sources(model, scans, config.prepare)
    with single_threaded_algebra():
        page = report_page(model, sources, config, scans or {}, workers)
    path = folder / "report.html"
    write_whole(path, page.encode("utf-8"))
    logger.debug("%s: %d bytes", path, len(page))
    return path


def _check_whole(model: ModelFolder) -> None:
    """Refuse a folder that lacks a part, or whose parts are of different runs."""
    path = model.path
    in_pairs = [name for pair in model.graph.pairs for name in (pair.i, pair.j)]
    if strangers := sorted({*model.poses.poses, *in_pairs} - set(model.report.scans)):
        raise ReadError(
            f"{path}: report.json does not know the scan {strangers[0]!r} of the other files; "
            "give the folder of one run"
        )
    fused = model.report.stages.get("fuse")
    if model.mesh is None and fused is not None and fused.counts.get("faces"):
        raise ReadError(f"{model.mesh_path}: is missing; copy the model folder as a whole")


def _settings(model: ModelFolder) -> Config:
    try:
        return Config.model_validate(model.report.settings)
    except ValidationError as error:
        where = ".".join(str(part) for part in error.errors()[0]["loc"])
        raise ReadError(
            f"{model.path / 'report.json'}: settings.{where} is of another version; run scanweld "
            "again"
        ) from error
