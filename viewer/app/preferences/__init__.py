"""Preferences of the user: looks, units, quality, keys; remembered between runs."""
