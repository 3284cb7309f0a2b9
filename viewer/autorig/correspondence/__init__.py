"""Correspondence: which vertices of a target lie on the template's surface."""
