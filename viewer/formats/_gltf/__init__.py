"""Parts of the glTF reader."""
