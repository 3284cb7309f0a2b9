"""Parts of the reader of the SMPL family."""
