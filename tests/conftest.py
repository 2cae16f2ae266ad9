"""What all tests share: settings of property tests, and scenes that are rendered only once."""

from hypothesis import settings

# The same examples in every run; a first call may compile, so no deadline.
settings.register_profile("scanweld", deadline=None, max_examples=60, derandomize=True)
settings.load_profile("scanweld")
