"""Keyed transforms: their values at given times, the resulting poses, and edits of their keys."""
