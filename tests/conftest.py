"""What all tests share: settings of property tests, and how many processes they run in."""

import os

import pytest
from hypothesis import settings

# Baselines of libraries repeat themselves on one thread only, and read this when they are loaded;
# and with one process a core, more threads would be in each other's way.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# The same examples in every run; a first call may compile, so no deadline.
settings.register_profile("scanweld", deadline=None, max_examples=60, derandomize=True)
settings.load_profile("scanweld")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """One process for each core that can be used; pytest-xdist may count a pair of them as one."""
    from scanweld.work.threads import num_workers  # loads NumPy, hence not before the above

    return num_workers(None)
