"""Limbs of a solid: their tree outwards from the trunk, their joints, pairs and names."""
