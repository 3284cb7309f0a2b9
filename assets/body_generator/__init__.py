"""Model, weigh and shape the bundled human body; one idea a module, driven by ``make_body.py``."""
