"""What ``info`` shows of a capture: lines of text, and a page with pictures."""

from collections.abc import Sequence
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from scanweld.app.capture_info import CaptureInfo, capture_info, info_text
from scanweld.app.html_report.cut_pictures import color_pictures, depth_picture
from scanweld.io import ScanFile, write_whole
from scanweld.io.depth.capture import Frame


def describe_capture(files: Sequence[ScanFile], where: str, page: Path | None = None) -> str:
    """A capture in lines of text; and a page with pictures, if it is asked for.

    Args:
        files: Its depth images.
        where: What the user named, for the heading.
        page: Where the page is to be written.

    Raises:
        WriteError: If it cannot be written.
    """
    frames = [file for file in files if isinstance(file, Frame)]
    info = capture_info(frames)
    if page is not None:
        write_whole(page, capture_page(where, info).encode("utf-8"))
    return info_text(where, info)


def capture_page(title: str, info: CaptureInfo) -> str:
    """A page in HTML that needs nothing else: what is known, and a picture of each frame."""
    environment = Environment(
        loader=PackageLoader("scanweld.app.html_report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    scans = {scan.name: scan for scan in info.scans}
    depths = {
        name: depth_picture(scan, info.kept.get(name), f"Depths of {name}")
        for name, scan in scans.items()
    }
    return environment.get_template("capture.html").render(
        title=title,
        rows=info.rows,
        depths=depths,
        photos=color_pictures(scans, scans),
        has_cut=bool(info.kept),
        unread=info.unread,
    )
