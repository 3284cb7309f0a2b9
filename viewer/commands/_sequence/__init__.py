"""Frames of motions: numbering, selection and output."""
