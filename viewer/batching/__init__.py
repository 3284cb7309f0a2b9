"""Processing of many files by one job: items, engines that run them, and the report."""
