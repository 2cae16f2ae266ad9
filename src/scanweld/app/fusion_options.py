"""Options of the commands that make a model: what its surface is to be like."""

from enum import StrEnum
from typing import Annotated, Any

import typer


class HolesName(StrEnum):
    """What becomes of what no scan saw."""

    OPEN = "open"
    FILL = "fill"
    CARVE = "carve"


class ComponentName(StrEnum):
    """Which connected pieces are kept."""

    ALL = "all"
    LARGEST = "largest"


HolesOption = Annotated[
    HolesName | None,
    typer.Option(help="What no scan saw: open (the default), fill it, or carve by empty space."),
]
ComponentOption = Annotated[
    ComponentName | None, typer.Option(help="Pieces to keep: all (the default), or the largest.")
]
WatertightOption = Annotated[
    bool, typer.Option("--watertight", help="A closed surface; holes are filled unless carved.")
]
SmoothOption = Annotated[
    int | None, typer.Option(min=0, max=1000, help="Rounds of smoothing; none if not given.")
]
FacesOption = Annotated[
    int | None, typer.Option(min=4, help="Triangles, about; all there are if not given.")
]


def fusion_settings(
    holes: HolesName | None,
    component: ComponentName | None,
    watertight: bool,
    smooth: int | None,
    faces: int | None,
) -> dict[str, Any]:
    """The options as settings of the section ``fusion``, None for those not given."""
    return {
        "holes": None if holes is None else holes.value,
        "component": None if component is None else component.value,
        "watertight": watertight or None,
        "smooth": smooth,
        "faces": faces,
    }
