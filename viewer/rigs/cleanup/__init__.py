"""Clean-up of captured motions: smoothing, gaps, frame rate, range, and tracks of people."""
