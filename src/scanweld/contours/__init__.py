"""Contour coherence: M-ICC and MM-ICC (paper 3.2)."""
