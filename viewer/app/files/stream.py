"""Reading of captures in the background while their first frames are shown."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Sequence

from viewer.app.core.jobs import unexpected
from viewer.diagnostics import Diagnostic
from viewer.errors import ViewerError
from viewer.loading.capturing import Builder
from viewer.progress import Cancelled, receiving
from viewer.rig.captures.capture import CapturePart
from viewer.rig.captures.points import PointClip
from viewer.rig.motion.evaluation import frame_rate
from viewer.rig.motion.sampled_clip import SampledClip, with_rate
from viewer.rig.retargeting.drive import Drive
from viewer.rig.scene import Actor

__all__ = ["Stream", "keep_rate"]

_Motions = list[tuple[Actor, Drive, SampledClip, list[Diagnostic]]]
_WAITING = 4  # maximum number of parts in the queue: limits memory


class Stream:
    """Thread that reads parts of captures, which the frame loop adds to the scene.

    Parameters
    ----------
    builders : sequence of Builder
        Builders of the captures; their actors are in the scene.
    wake : callable
        Called from the thread when a part is ready.

    Attributes
    ----------
    error : str
        Reason why reading ended early; empty if there is no error.
    finishing : float
        Completed fraction of the final motions of driven figures; negative before they are begun.
    """

    def __init__(self, builders: Sequence[Builder], wake: Callable[[], None]) -> None:
        self.builders = tuple(builder for builder in builders if not builder.is_done)
        self.error, self.finishing = "", -1.0
        self._wake = wake
        self._parts: queue.Queue[tuple[Builder, CapturePart | _Motions]] = queue.Queue(_WAITING)
        for builder in self.builders:
            builder.defers = True
        self._stop, self._is_waiting = threading.Event(), False
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        try:
            for builder in self.builders:
                for part in builder.parts():
                    if builder.is_cut:
                        break
                    if not self._hand_over(builder, part):
                        return
                if not self._finish(builder):
                    return
        except Cancelled:
            return
        except ViewerError as problem:
            self.error = str(problem)
        except MemoryError:
            self.error = f"{self.builders[0].capture.name}: not enough memory"
        except BaseException as problem:  # a programming error: the traceback is printed
            self.error = unexpected(self.builders[0].capture.name, problem)
            raise
        finally:
            if not self._stop.is_set():  # the window may have been closed
                self._wake()

    def _finish(self, builder: Builder) -> bool:
        """Compute the final motions after all parts were added; return False if cancelled."""
        self._is_waiting = True
        while self._parts.unfinished_tasks:
            if self._stop.wait(0.02):
                return False
        self._is_waiting = False
        # Cancelling takes effect between two steps of the work.
        with receiving(self._receive):
            motions = builder.final_motions()
        return self._hand_over(builder, motions) if motions else True

    def _receive(self, done: int, total: int, unit: str, what: str) -> None:
        if self._stop.is_set():
            raise Cancelled
        self.finishing = done / max(total, 1)
        self._wake()

    def _hand_over(self, builder: Builder, part: CapturePart | _Motions) -> bool:
        """Put a part into the queue when it has room; return False if reading was cancelled."""
        while not self._stop.is_set():
            try:
                self._parts.put((builder, part), timeout=0.1)
            except queue.Full:
                continue
            self._wake()
            return True
        return False

    def take(self) -> tuple[list[Actor], list[Diagnostic], bool]:
        """Add the parts read since the last call to the scene.

        Returns
        -------
        new : list of Actor
            Actors of people who appeared.
        notes : list of Diagnostic
            Messages about the parts.
        grew : bool
            Whether anything was added.

        Raises
        ------
        RigError
            If bodies do not match the model; the stream then ends.
        """
        new: list[Actor] = []
        notes: list[Diagnostic] = []
        grew = False
        while True:
            try:
                builder, part = self._parts.get_nowait()
            except queue.Empty:
                return new, notes, grew
            try:
                if builder.is_cut:
                    continue
                grew = True
                if isinstance(part, list):
                    notes += builder.finish(part)
                    continue
                known = builder.actors
                more, said = builder.add(part)
                # The user may have changed the frame rate since the first person appeared.
                keep_rate(known[:1], more)
                new += more
                notes += said
            finally:
                self._parts.task_done()

    @property
    def is_done(self) -> bool:
        """Whether everything has been read and added."""
        return not self._thread.is_alive() and self._parts.empty()

    @property
    def progress(self) -> tuple[int, int]:
        """Number of frames in the scene, and their total."""
        read = sum(builder.n_read for builder in self.builders)
        return read, sum(builder.capture.n_frames for builder in self.builders)

    def cancel(self) -> None:
        """Stop reading; frames already in the scene remain."""
        self._stop.set()
        for builder in self.builders:
            builder.is_cut = True

    def wait(self) -> None:
        """Wait until the thread has ended or waits for parts to be added; used by tests."""
        while self._thread.is_alive():
            self._thread.join(0.01)
            if self._parts.full() or self._is_waiting:
                return


def keep_rate(known: Sequence[Actor], new: Sequence[Actor]) -> None:
    """Set the frame rate of new people to that of the people in the scene."""
    for first in known:
        for actor in new:
            if isinstance(actor.clip, SampledClip | PointClip):
                actor.clip = with_rate(actor.clip, frame_rate(first.clip))
