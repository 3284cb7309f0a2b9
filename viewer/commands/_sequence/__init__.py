"""Frames of motions: their numbers, which of them are drawn, and into what."""
