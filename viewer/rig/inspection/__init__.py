"""Facts about vertices and bodies, and explanations of where a vertex is."""
