"""Recording: pictures and videos of what is shown."""
