"""How work is carried out: threads, progress, the log of stages, compiled kernels."""
