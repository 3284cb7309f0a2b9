"""Meshes as several formats have them: polygons, surfaces and textures."""
