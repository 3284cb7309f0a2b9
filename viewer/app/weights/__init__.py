"""Weights: scalar quantities as colours, hover text, and explanations of single vertices."""
