"""Judged pairs -> poses of all scans: view graph and joint refinement."""
