"""What all tests share: settings of property tests, and scenes that are rendered only once."""

import os

from hypothesis import settings

# Baselines of libraries repeat themselves on one thread only, and read this when they are loaded.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# The same examples in every run; a first call may compile, so no deadline.
settings.register_profile("scanweld", deadline=None, max_examples=60, derandomize=True)
settings.load_profile("scanweld")
