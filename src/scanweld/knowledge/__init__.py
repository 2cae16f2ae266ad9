"""What users know of their scans beforehand, and how it stands against the evidence."""
