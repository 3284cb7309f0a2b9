"""Compressed pickles as written by joblib."""
