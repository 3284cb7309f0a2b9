"""Compressed pickles, as joblib writes them."""
