"""What the set says of its sensor: noise, how far silhouettes can be believed, what stood still."""
