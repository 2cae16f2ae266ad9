"""Two scans to judged relative poses: the search, and the verdict."""
