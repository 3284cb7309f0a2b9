"""Text, marks and legends drawn over a picture."""
