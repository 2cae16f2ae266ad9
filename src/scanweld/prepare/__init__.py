"""Scan -> range image with a located sensor, mesh and samples."""

from scanweld.prepare.prepare import prepare

__all__ = ["prepare"]
