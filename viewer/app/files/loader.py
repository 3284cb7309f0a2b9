"""Loading of files in a thread: the window stays responsive, and loading can be cancelled."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.errors import ViewerError
from viewer.loading import Contents, MotionSettings, begin, read_files
from viewer.progress import Cancelled, receiving
from viewer.rendering.gpu.index_sets import prepare_scene
from viewer.rig.scene import Scene

if TYPE_CHECKING:
    from viewer.loading.capturing import Builder

__all__ = ["Loader"]


class Loader:
    """Thread that reads files.

    Dropping a loader discards its result.

    Parameters
    ----------
    paths : sequence of Path
        Files to open.
    attempts : sequence of sequences of Path
        Tried in order until one loads; if all fail, the last error is reported.
    wake : callable
        Called from the thread when loading ends.
    settings : MotionSettings, optional
        Settings for reading motions.
    opened : sequence of Path
        Files of the current scene, to whose figures the motions are applied.

    Attributes
    ----------
    scene : Scene or None
        The scene that was read.
    builders : list of Builder
        Builders of captures whose first frames are in the scene.
    addition : Contents or None
        Poses and images for the open figure, if the files contain nothing else.
    error : str
        Reason why nothing was read; empty if there is no error.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        attempts: Sequence[Sequence[Path]],
        wake: Callable[[], None],
        settings: MotionSettings | None = None,
        opened: Sequence[Path] = (),
    ) -> None:
        self.paths: tuple[Path, ...] = tuple(paths)
        self.scene: Scene | None = None
        self.builders: list[Builder] = []
        self.addition: Contents | None = None
        self.error = ""
        self._attempts, self._wake, self._settings = attempts, wake, settings
        self._opened = tuple(opened)
        self._is_cancelled = False
        self._progress = (0, 0, "")
        self._started = time.monotonic()
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        try:
            with receiving(self._receive):
                self._try_all()
        except Cancelled:
            return
        self._wake()

    def _receive(self, done: int, total: int, unit: str, _: str) -> None:
        if self._is_cancelled:
            raise Cancelled
        self._progress = (done, total, unit)

    def _try_all(self) -> None:
        for paths in self._attempts:
            try:
                self._read_one(paths)
                if self.scene is not None:
                    prepare_scene(self.scene)
                self.error = ""
                break
            except ViewerError as problem:
                self.error = str(problem)
            except MemoryError:
                self.error = f"{paths[-1]}: not enough memory"

    def _read_one(self, paths: Sequence[Path]) -> None:
        contents = read_files(paths, settings=self._settings)
        self.paths = tuple(paths)
        if contents.is_addition:
            self.addition = contents
        elif contents.needs_figure and self._opened:
            self._join(contents, paths)
        else:
            self.scene, self.builders = begin(contents, self._settings)

    def _join(self, contents: Contents, paths: Sequence[Path]) -> None:
        """Apply motions to the open figures; motions that match none are shown separately."""
        from viewer.loading.body_models import is_body

        opened = read_files(self._opened, settings=self._settings)
        figures = opened.figures
        if contents.only_bodies and not any(is_body(figure) for _, figure in figures):
            figures = []  # people drawn with the bundled body replace the scene
        kept = {path for path, _ in figures} | {path for path, _ in opened.morphs}
        morphs = [*opened.morphs, *contents.morphs]
        joined = replace(contents, figures=figures, groups=opened.groups, morphs=morphs)
        joined.used_options = (contents.used_options or set()) | (opened.used_options or set())
        count = len(begin(replace(joined, captures=[], skeleton_motions=[]))[0].actors)
        self.scene, self.builders = begin(joined, self._settings)
        if contents.skeleton_motions and len(self.scene.actors) > count:
            # A BVH that drives no open figure is shown separately.
            kept = set()
            self.scene, self.builders = begin(contents, self._settings)
        self.paths = (*(path for path in self._opened if path in kept), *paths)

    @property
    def is_done(self) -> bool:
        """Whether there is a scene or an error."""
        return not self._thread.is_alive()

    @property
    def progress(self) -> tuple[int, int, str]:
        """Completed steps, their total and their unit; the total is 0 if it is unknown."""
        return self._progress

    def cancel(self) -> None:
        """Stop reading at the next part of a file."""
        self._is_cancelled = True

    @property
    def seconds(self) -> float:
        """Seconds since loading began."""
        return time.monotonic() - self._started

    def wait(self) -> None:
        """Wait until loading ends."""
        self._thread.join()
