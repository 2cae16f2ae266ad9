"""Formats of scans and meshes: a module each, which the registry finds."""
