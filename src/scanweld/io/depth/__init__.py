"""Depth images of cameras whose intrinsics are known, as scans."""
