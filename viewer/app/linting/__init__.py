"""Linting: checks of the scene, and their findings in a panel and in the view."""
