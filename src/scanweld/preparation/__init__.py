"""Scan -> range image with a located sensor, mesh and samples."""

from scanweld.preparation.prepare import prepare, stands_on_support

__all__ = ["prepare", "stands_on_support"]
