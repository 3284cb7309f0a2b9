"""Keyed transforms: evaluation, resulting poses, and editing of keys."""
