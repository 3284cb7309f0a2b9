"""Automatic rigging: alignment, correspondence, weights and joints from a template figure."""
