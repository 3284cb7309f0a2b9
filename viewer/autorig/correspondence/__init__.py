"""Correspondence between a target's vertices and the template's surface."""
