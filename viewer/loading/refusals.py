"""Errors about figures that a motion does not match."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from viewer.diagnostics import Diagnostic
from viewer.errors import RigError

__all__ = ["map_refusal", "model_refusal"]


def model_refusal(problem: RigError, path: Path | None) -> RigError:
    """Return the error that the requested model does not match.

    Parameters
    ----------
    problem : RigError
        Why it does not match; returned unchanged if it has a file of its own, as of a joint map.
    path : Path or None
        File of the motion.
    """
    cause = problem.cause
    if isinstance(cause, Diagnostic) and cause.path is not None:
        return problem
    return RigError(Diagnostic("F004.model", path, values={"problem": cause}))


def map_refusal(problem: RigError, path: Path | None) -> RigError:
    """Return the error that a joint map fits no figure; see ``model_refusal``."""
    cause = problem.cause
    if isinstance(cause, Diagnostic) and cause.path is None:
        return RigError(replace(cause, path=path))
    return problem
