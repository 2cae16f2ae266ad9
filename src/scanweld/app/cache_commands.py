"""What is kept of runs beside their outputs: ``cache info`` and ``cache clear``."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from scanweld.app.cache import CacheSize

app = typer.Typer(help="Finished work that runs keep beside outputs.", rich_markup_mode=None)
Folder = Annotated[Path, typer.Argument(metavar="[FOLDER]", help="Where models were made.")]


@app.command()
def info(folder: Folder = Path()) -> None:
    """Show how much is kept."""
    from scanweld.app.cache import NAME, FileCache

    typer.echo(_told(folder / NAME, FileCache(folder / NAME).size(), "kept"))


@app.command()
def clear(folder: Folder = Path()) -> None:
    """Remove all that is kept: nothing but time is lost."""
    from scanweld.app.cache import NAME, FileCache

    typer.echo(_told(folder / NAME, FileCache(folder / NAME).clear(), "removed"))


def _told(place: Path, size: "CacheSize", what: str) -> str:
    plural = "" if size.records == 1 else "s"
    return f"{place}: {size.records} record{plural} {what}, {size.bytes / 1e6:.1f} MB"
