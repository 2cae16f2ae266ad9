"""What the set says of its sensor: noise, silhouettes, what stood still, whose scale is off."""
