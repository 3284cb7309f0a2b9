"""Recording the view as images or video."""
