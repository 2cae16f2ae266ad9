"""Poses, cameras, scans, range images and meshes: what every stage stands on."""
