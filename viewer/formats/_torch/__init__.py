"""Files of torch: zip archives since version 1.6, and the legacy streams before."""
