"""Scan -> range image with a located sensor, mesh and samples."""
