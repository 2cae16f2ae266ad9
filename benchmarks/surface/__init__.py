"""Measures of meshes that benchmarks alone need."""
