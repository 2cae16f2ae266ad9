"""Contour sets of two views, their prunings and coherence (paper 3.2)."""
