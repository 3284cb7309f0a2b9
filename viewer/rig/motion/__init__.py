"""Motion: clips, sampled animations, and the poses that they give at a time."""
