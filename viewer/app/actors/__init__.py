"""Actors: visibility, colour and placement of figures, and a camera that follows one."""
