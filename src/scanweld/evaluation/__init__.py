"""Virtual scanner, made objects and error measures."""
