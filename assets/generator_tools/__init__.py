"""Tools shared by the generators of the bundled figures: shapes, remeshing, diffusion."""
