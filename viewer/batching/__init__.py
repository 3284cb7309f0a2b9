"""Many files through one job: items, engines that run them, and the report."""
