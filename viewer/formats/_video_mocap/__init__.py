"""Results of video motion capture: one module per tool, and their common parts."""
