"""What ``scanweld export`` writes, and what ``scanweld fuse`` makes of known poses."""
