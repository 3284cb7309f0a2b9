"""Retargeting of motions and poses from one skeleton to another."""
