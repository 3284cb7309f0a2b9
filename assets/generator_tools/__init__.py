"""What the generators of the bundled figures share: shapes, polygons, remeshing, diffusion."""
