"""A pickle reader that executes no code."""
