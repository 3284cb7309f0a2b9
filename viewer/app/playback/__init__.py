"""Playback: the timeline and its frames."""
