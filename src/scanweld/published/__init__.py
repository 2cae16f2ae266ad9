"""The method as published: PA-HKS matching and ICP, then M-ICC or MM-ICC."""
