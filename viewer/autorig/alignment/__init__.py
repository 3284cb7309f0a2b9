"""Alignment of a template figure with a target mesh: rigid, scaled, posed, resized."""
