"""Properties of triangle surfaces: connectivity, winding, samples, Laplace operators."""
