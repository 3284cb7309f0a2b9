"""Numbers and words of text files."""
