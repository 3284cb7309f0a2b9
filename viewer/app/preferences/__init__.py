"""User preferences: appearance, units, quality, keys; stored between runs."""
