"""Render passes, each of which draws one kind of object into the bound framebuffer."""
