"""Cuts the object out of whole depth frames: off with the table and all that stands still."""

from scanweld.cut.cutting import CutSet, cut_out, with_only

__all__ = ["CutSet", "cut_out", "with_only"]
