"""Cuts the object out of whole depth frames: off with the table and all that stands still."""

from scanweld.cut.carried import Stood
from scanweld.cut.cutting import CutSet, cut_out
from scanweld.cut.frames import camera_of
from scanweld.cut.masks import mask_of, mask_text, with_only

__all__ = ["CutSet", "Stood", "camera_of", "cut_out", "mask_of", "mask_text", "with_only"]
