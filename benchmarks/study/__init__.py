"""Shared parts of the benchmarks: units of work that are kept, what is right, pages and plots."""
