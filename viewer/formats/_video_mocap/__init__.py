"""Results of video motion capture: one module per tool, and what they have in common."""
