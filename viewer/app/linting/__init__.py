"""Linting: checks of the scene, their findings, and where those are."""
