"""Posing: pose records and pose vectors, DOF values as text, inverse kinematics."""
