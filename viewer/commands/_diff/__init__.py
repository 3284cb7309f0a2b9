"""Parts of ``viewer diff``."""
