"""Parts of the glTF exporter."""
