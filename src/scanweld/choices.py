"""Named choices that settings and the command line share."""

from typing import Literal

Unit = Literal["m", "cm", "mm", "in"]
Method = Literal["robust", "paper"]
Holes = Literal["open", "fill", "carve"]
Component = Literal["largest", "all"]
Shown = Literal["auto", "moving", "all"]
