"""Transfer of skin weights: matched, inpainted, smoothed, or copied from the nearest vertex."""
