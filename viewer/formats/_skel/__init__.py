"""Parts of the ``.skel`` reader and writer."""
