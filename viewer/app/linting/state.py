"""State of the Lint panel: the findings of the last check, filters, and the chosen one."""

from __future__ import annotations

from dataclasses import field

from viewer.app.core.jobs import CountedJob
from viewer.data_classes import dataclass
from viewer.lint import SEVERITIES, Finding, LintOptions
from viewer.rendering.overlay.annotation import Marks
from viewer.rig.scene import Scene

__all__ = ["Checked", "Linting", "Running"]


@dataclass(frozen=True, slots=True, eq=False)
class Checked:
    """Result of a check.

    Attributes
    ----------
    source : Scene
        The scene that the window shows.
    scene : Scene
        A copy of the scene, made when the check began.
    options : LintOptions
        Limits of the check.
    findings : tuple of Finding
        Findings, most severe first.
    n_files : int
        Number of files of the scene that were read again.
    notes : tuple of str
        Changes of these files since they were opened.
    """

    source: Scene
    scene: Scene
    options: LintOptions
    findings: tuple[Finding, ...]
    n_files: int = 0
    notes: tuple[str, ...] = ()


@dataclass(slots=True, eq=False)
class Running:
    """A check that runs in a thread, which stores its result here."""

    job: CountedJob | None = None
    result: Checked | None = None


@dataclass(slots=True)
class Linting:
    """State of the Lint panel.

    Attributes
    ----------
    options : LintOptions
        Limits of the next check.
    checked : Checked or None
        The last completed check.
    running : Running or None
        The check in progress.
    was_shown : bool
        Whether the panel has been shown before: showing it for the first time starts a check.
    severities : set of str
        Severities to list.
    text : str
        Text that listed findings must contain.
    chosen : int
        Index of the chosen finding, -1 for none.
    wants_aim : bool
        Whether the camera moves to the chosen finding once the scene is posed.
    is_edited : bool
        Whether a moving actor was posed by hand since the check.
    seen : tuple
        Time and poses of moving actors in the previous frame.
    marks : Marks or None
        Marks of the chosen finding.
    marks_key : object
        Key that identifies the marks.
    marks_note : str
        Note about parts of the finding that are not marked; empty if all are.
    """

    options: LintOptions = field(default_factory=LintOptions)
    checked: Checked | None = None
    running: Running | None = None
    was_shown: bool = False
    severities: set[str] = field(default_factory=lambda: set(SEVERITIES))
    text: str = ""
    chosen: int = -1
    wants_aim: bool = False
    is_edited: bool = False
    seen: tuple[object, ...] = ()
    marks: Marks | None = None
    marks_key: object = None
    marks_note: str = ""

    @property
    def finding(self) -> Finding | None:
        """The chosen finding."""
        known = self.checked
        if known is None or not 0 <= self.chosen < len(known.findings):
            return None
        return known.findings[self.chosen]
