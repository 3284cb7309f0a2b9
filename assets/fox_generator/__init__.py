"""Generator of the sample fox, run by ``make_fox.py``."""
