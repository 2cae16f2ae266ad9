"""scanweld: unordered range scans of an object to one registered, fused model and a verdict."""
