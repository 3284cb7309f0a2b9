"""Rigging of a mesh with the rig of a template: alignment, matching, transfer and results."""
