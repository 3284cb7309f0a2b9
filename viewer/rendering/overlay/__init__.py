"""Text, markers and legends drawn over an image."""
