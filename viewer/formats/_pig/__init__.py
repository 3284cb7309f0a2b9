"""Parts of the PIG reader."""
