"""Pictures, videos and atomic saving."""
