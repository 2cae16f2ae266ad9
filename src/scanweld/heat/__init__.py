"""PA-HKS keypoints (paper 3.1)."""
