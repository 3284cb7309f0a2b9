"""Facts about vertices and bodies, and step-by-step explanations of a vertex's position."""
