"""Passes: each draws one kind of thing into the bound framebuffer."""
