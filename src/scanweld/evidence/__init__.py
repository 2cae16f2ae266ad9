"""What the sensors of two scans say of ONE relative pose: visibility, matches, information."""
