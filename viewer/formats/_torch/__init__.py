"""Torch files: zip archives since version 1.6, and legacy streams before."""
