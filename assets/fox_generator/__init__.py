"""Model, skin and paint the sample fox; one idea a module, driven by ``make_fox.py``."""
