"""Parts of the ``.obj`` reader."""
