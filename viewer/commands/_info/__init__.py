"""Parts of ``viewer info``."""
