"""Drawing with OpenGL 3.3 through moderngl, with or without a window."""
