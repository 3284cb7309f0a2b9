"""A rig carried over from one figure to another mesh."""
