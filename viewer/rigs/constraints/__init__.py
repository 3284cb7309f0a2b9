"""Constraints: joints whose rotations follow other joints."""
