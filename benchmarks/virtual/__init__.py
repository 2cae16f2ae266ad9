"""Virtual scans of made objects under named conditions, with the truth about them."""
