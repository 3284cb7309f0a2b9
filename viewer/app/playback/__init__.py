"""Playback: the timeline, frame rate and playback range."""
