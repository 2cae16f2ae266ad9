"""What the main job says of virtual scans, held against the truth."""
