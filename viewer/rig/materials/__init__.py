"""Textures, toon shading, and changes of materials by expressions."""
