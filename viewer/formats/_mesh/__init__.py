"""Mesh data that several formats share: polygons, surfaces and textures."""
