"""PA-HKS keypoints (paper 3.1)."""

from scanweld.heat.features import Features, describe

__all__ = ["Features", "describe"]
