"""Materials of glTF documents: their textures, images, and older models."""
