"""Violations of the glTF specification that have no effect on reading, reported only by lint."""
