"""Rigging: a mesh gets the rig of a template."""
