"""Feet of moving bodies: legs, soles, contacts with the ground, and feet planted during them."""
