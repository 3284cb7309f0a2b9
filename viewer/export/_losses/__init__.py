"""Differences between a motion and the file that was written of it."""
