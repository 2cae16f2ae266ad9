"""Poses of many scans refined together by surfaces and contours."""
