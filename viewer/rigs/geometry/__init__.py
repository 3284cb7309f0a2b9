"""Geometry: rotations, transforms, rays and closest points."""
