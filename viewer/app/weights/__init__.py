"""Weights: numbers of vertices as colours, and explanations of single vertices."""
