"""Steps of ``make_gallery.py``."""
