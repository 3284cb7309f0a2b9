"""Match of joints between a figure and the motion of another skeleton that drives it."""
