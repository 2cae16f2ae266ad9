"""Two scans -> judged relative poses."""
