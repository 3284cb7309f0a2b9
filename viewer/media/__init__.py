"""Images, videos and atomic saving."""
