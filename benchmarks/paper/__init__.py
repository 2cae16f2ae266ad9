"""The paper's tables and figures, and more of their kind: ``python -m benchmarks.paper``."""
