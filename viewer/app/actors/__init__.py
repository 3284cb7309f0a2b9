"""Actors: the figures of the scene, and a camera that follows one."""
