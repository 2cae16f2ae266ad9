"""What commands take: options as records, and those that several commands share."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import typer

from scanweld.app.json_lines import finished_line
from scanweld.app.progress import reporting
from scanweld.app.summary import summary
from scanweld.config import Holes, Unit
from scanweld.reconstruction import Reconstruction
from scanweld.work.progress import Progress

NOT_GOOD = 3
"""Exit code of a result that is less than it could be."""

Options = TypeVar("Options")

Inputs = Annotated[
    list[str], typer.Argument(metavar="INPUTS...", help="Scan files, folders or glob patterns.")
]
Output = Annotated[Path, typer.Option("-o", "--output", help="Folder to be made.")]
ConfigFile = Annotated[Path | None, typer.Option("--config", help="Settings, a TOML file.")]
Workers = Annotated[int | None, typer.Option(min=1, help="Threads; all cores if not given.")]
Force = Annotated[bool, typer.Option("--force", help="Replace an output that is there already.")]
UnitOption = Annotated[Unit | None, typer.Option(help="Unit of the scans' coordinates.")]
MovedScans = Annotated[list[str], typer.Option(help="The scans, if they have been moved since.")]


def takes(kind: type[Options]) -> Callable[[Callable[[Options], None]], Callable[..., None]]:
    """Make a function of one record a command as typer wants it: a function of many parameters.

    Args:
        kind: A dataclass. Its fields are the command's arguments and options, in their order; a
            field that is a dataclass itself stands for the fields of that one.
    """

    def command(function: Callable[[Options], None]) -> Callable[..., None]:
        @wraps(function)
        def call(**given: Any) -> None:
            function(_filled(kind, given))

        parameters = list(_parameters(kind))
        call.__annotations__ = {each.name: each.annotation for each in parameters}
        call.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
        return call

    return command


def _parameters(kind: Any) -> Iterator[Parameter]:
    for field in fields(kind):
        if is_dataclass(field.type):
            yield from _parameters(field.type)
            continue
        default = Parameter.empty if field.default is MISSING else field.default
        if field.default_factory is not MISSING:
            default = field.default_factory()
        yield Parameter(field.name, Parameter.KEYWORD_ONLY, default=default, annotation=field.type)


def _filled(kind: Any, given: Mapping[str, Any]) -> Any:
    return kind(
        **{
            field.name: _filled(field.type, given)
            if is_dataclass(field.type)
            else given[field.name]
            for field in fields(kind)
        }
    )


@dataclass(frozen=True, kw_only=True)
class SurfaceOptions:
    """What the model's surface is to be like."""

    holes: Annotated[
        Holes | None,
        typer.Option(
            help="What no scan saw: open (the default), fill it, or carve by empty space."
        ),
    ] = None
    component: Annotated[
        Literal["all", "largest"] | None,
        typer.Option(help="Pieces to keep: all (the default), or the largest."),
    ] = None
    watertight: Annotated[
        bool,
        typer.Option("--watertight", help="A closed surface; holes are filled unless carved."),
    ] = False
    smooth: Annotated[
        int | None, typer.Option(min=0, max=1000, help="Rounds of smoothing; none if not given.")
    ] = None
    faces: Annotated[
        int | None, typer.Option(min=4, help="Triangles, about; all there are if not given.")
    ] = None

    def settings(self) -> dict[str, Any]:
        """Settings of the section ``fusion``; None, or left out, where an option is not given."""
        return {**vars(self), "watertight": self.watertight or None}


@dataclass(frozen=True, kw_only=True)
class ShowOptions:
    """What is printed of a run and its result."""

    as_json: Annotated[
        bool,
        typer.Option("--json", help="Tell of progress and the verdict as JSON, a line an event."),
    ] = False
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Warnings only, no progress.")] = (
        False
    )
    verbose: Annotated[bool, typer.Option("-v", "--verbose", help="A detailed log.")] = False

    def reporting(self) -> AbstractContextManager[Progress]:
        """Shows progress for as long as the context lasts."""
        return reporting(quiet=self.quiet, verbose=self.verbose, as_json=self.as_json)

    def finish(self, result: Reconstruction, output: Path) -> None:
        """Print the verdict, and leave with its exit code."""
        typer.echo((finished_line if self.as_json else summary)(result, output))
        raise typer.Exit(result.verdict.exit_code)
