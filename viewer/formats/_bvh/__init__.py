"""Parts of the ``.bvh`` reader."""
