"""Check every rig of a repository; the exit code is 1 if one has findings."""

import sys

import viewer
from viewer.models import resolve

# Your files: lint_in_ci.py 'characters/**/*.glb'
paths = sys.argv[1:] or [str(resolve("body"))]
strict = ["--fail-on", "warning"]
report = viewer.batch(paths, "lint", options=strict, workers=0, table="findings.csv", force=True)
for result in report.results:
    print(f"{result.item.name}: {result.status}, exit code {result.exit_code}")
    print(result.message or result.text)
sys.exit(not report.is_complete)
