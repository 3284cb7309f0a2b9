"""Parts of the ``.ply`` reader."""
