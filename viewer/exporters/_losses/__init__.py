"""Measured errors of exported files: differences from the original motion."""
