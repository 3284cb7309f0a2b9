"""Posing: records and vectors of poses, DOFs as text, inverse kinematics."""
