"""The manual's pages in the window."""
