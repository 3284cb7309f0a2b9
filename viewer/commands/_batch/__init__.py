"""Parts of ``viewer batch``: jobs, options, the plan of a run, progress and summary."""
