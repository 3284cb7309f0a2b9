"""Parts of the BVH exporter."""
