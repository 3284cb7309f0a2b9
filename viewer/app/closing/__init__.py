"""Questions before running jobs or unsaved edits are lost."""
