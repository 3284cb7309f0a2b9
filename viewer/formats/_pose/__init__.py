"""Parts of the reader of pose files."""
