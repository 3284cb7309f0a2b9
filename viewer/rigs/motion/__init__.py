"""Motion: clips, sampled animations, and their poses at a given time."""
