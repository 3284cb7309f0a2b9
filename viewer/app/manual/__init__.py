"""Window with the pages of the manual."""
