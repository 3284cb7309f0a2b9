"""Parts of the ``.skin`` reader."""
