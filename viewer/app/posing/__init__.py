"""Posing by hand: joints, shapes, hands, and the tools in the view."""
