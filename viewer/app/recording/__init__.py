"""Recording: pictures and videos of the view."""
