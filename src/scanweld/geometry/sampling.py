"""How many of many are looked at where a part of them tells what all would."""

NUM_SAMPLED = 20_000
"""Points of a scan or a model that tell how it is made, in any part of it."""
NUM_FEW = 2_000
"""Points whose median is good to 2 %, and so is what share of them is one way or another."""
NUM_FRAMES = 24
"""Frames, evenly over a capture, that tell what is true of all of them."""
