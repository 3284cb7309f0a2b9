"""Captures: people, keypoints and cameras of recordings."""
