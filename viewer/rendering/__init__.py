"""Drawing with OpenGL 3.3 through moderngl: the same code for a window and without one."""
