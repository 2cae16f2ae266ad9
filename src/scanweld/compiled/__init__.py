"""Compiled kernels: how they are made, and under which digest of their source they are kept."""
