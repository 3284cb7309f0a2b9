"""Submissions: folders and zip archives, each compared with one reference."""

from __future__ import annotations

from viewer.batching.submissions.opening import Submission, opened
from viewer.batching.submissions.search import Found, find_submissions, is_archive

__all__ = ["Found", "Submission", "find_submissions", "is_archive", "opened"]
