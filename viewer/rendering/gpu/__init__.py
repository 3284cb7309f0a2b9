"""OpenGL objects: context, programs, buffers, textures and targets."""
