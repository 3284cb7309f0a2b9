"""A pickle reader that runs no code."""
