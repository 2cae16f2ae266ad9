"""Descriptors of other papers, to compare PA-HKS with."""
