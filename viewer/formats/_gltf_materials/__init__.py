"""Materials of glTF files: their surfaces, textures and images."""
