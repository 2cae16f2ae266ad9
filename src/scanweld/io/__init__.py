"""Reading scans, meshes and poses; writing models and poses."""
