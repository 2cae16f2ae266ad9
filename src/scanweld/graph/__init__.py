"""Judged pairs -> components of placed scans: merging, and what is said of those left out."""
