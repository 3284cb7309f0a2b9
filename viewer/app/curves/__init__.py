"""Curves: plotting and editing of the channels and keys of a clip."""
