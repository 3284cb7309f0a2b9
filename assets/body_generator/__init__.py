"""Generator of the bundled human body, run by ``make_body.py``."""
