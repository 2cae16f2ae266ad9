"""Posed scans -> one surface."""
