"""Curves: the channels and keys of a clip, shown and edited."""
