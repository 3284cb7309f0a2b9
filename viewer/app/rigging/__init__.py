"""Rigging a mesh from a template: alignment, matching, transfer and results."""
