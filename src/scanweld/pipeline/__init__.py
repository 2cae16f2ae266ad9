"""The run: scans in, reconstruction out, by either method."""
