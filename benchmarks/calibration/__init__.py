"""Calibration of the confidence: virtual sets of made objects -> calibration.json."""
