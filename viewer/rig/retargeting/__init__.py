"""Motions and poses of one skeleton on another."""
