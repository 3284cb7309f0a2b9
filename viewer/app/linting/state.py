"""State of the Lint panel: the findings of the last check, filters, and the chosen one."""

from __future__ import annotations

from dataclasses import dataclass, field

from viewer.app.core.jobs import CountedJob
from viewer.lint import SEVERITIES, Finding, LintOptions
from viewer.rendering.overlay.marks import Marks
from viewer.rig.scene import Scene

__all__ = ["Checked", "Linting", "Running"]


@dataclass(frozen=True, slots=True, eq=False)
class Checked:
    """A scene that was checked.

    Attributes
    ----------
    source : Scene
        The scene that the window shows.
    scene : Scene
        A copy of it as it was when the check began.
    options : LintOptions
        What counted as a fault.
    findings : tuple of Finding
        The worst first.
    n_files : int
        How many files it came from, which were read again.
    notes : tuple of str
        What of these files is not as it was.
    """

    source: Scene
    scene: Scene
    options: LintOptions
    findings: tuple[Finding, ...]
    n_files: int = 0
    notes: tuple[str, ...] = ()


@dataclass(slots=True, eq=False)
class Running:
    """A check that goes on in a thread, which puts its result here."""

    job: CountedJob | None = None
    result: Checked | None = None


@dataclass(slots=True)
class Linting:
    """The Lint panel's own state.

    Attributes
    ----------
    options : LintOptions
        What counts as a fault when it is checked next.
    checked : Checked or None
        The last check that ended.
    running : Running or None
        The one that goes on.
    was_shown : bool
        Whether the panel was ever shown: it checks by itself the first time.
    severities : set of str
        Those that are listed.
    text : str
        Only findings with this in their words are listed.
    chosen : int
        Index of the finding that is looked at, -1 for none.
    wants_aim : bool
        The camera goes to the chosen finding when the scene has been posed next.
    is_edited : bool
        Whether what moves was posed by hand since the check.
    seen : tuple
        Time and poses of what moves, a frame ago.
    marks : Marks or None
        Of the chosen finding.
    marks_key : object
        What they depend on.
    marks_note : str
        What of the finding is not marked; empty if all is.
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
        """The finding that is looked at."""
        known = self.checked
        if known is None or not 0 <= self.chosen < len(known.findings):
            return None
        return known.findings[self.chosen]
