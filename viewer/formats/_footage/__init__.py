"""Footage of cameras: the frames of a video."""
