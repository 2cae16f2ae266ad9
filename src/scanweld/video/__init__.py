"""Video of a depth camera that moves -> a few averaged keyframes, which are ordinary scans."""
