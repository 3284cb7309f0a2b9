"""Files: opening, saving and exporting from the window."""
