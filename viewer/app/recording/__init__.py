"""Recording of the view as pictures or video."""
