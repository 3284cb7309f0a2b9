"""Parts of the EasyMocap reader."""
