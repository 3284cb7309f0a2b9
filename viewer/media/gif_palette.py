"""The 256-colour palette of a GIF, chosen from a few frames; pixels get an ordered dither.

With one palette for the whole video, static regions are identical from frame to frame and are not
stored again, which makes the file five times smaller than with a palette per frame. The dither is
ordered (a fixed pattern) for the same reason.
"""

from __future__ import annotations

from fractions import Fraction
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from av.filter.graph import Graph
    from av.video.frame import VideoFrame

__all__ = ["PaletteChooser", "PaletteUser"]

_HUNDREDTH = Fraction(1, 100)  # seconds, the time unit of GIF
_PALETTE_SIDE = 16  # FFmpeg stores a palette as an image of 16 x 16


class PaletteChooser:
    """Chooses colours by median cut over some frames (FFmpeg's ``palettegen``).

    Parameters
    ----------
    library : module
        PyAV.
    size : (int, int)
        Width and height.
    """

    def __init__(self, library: ModuleType, size: tuple[int, int]) -> None:
        self._graph: Graph = library.filter.Graph()
        source = self._graph.add_buffer(
            width=size[0], height=size[1], format="rgba", time_base=_HUNDREDTH
        )
        # One colour stands for both "transparent" and "unchanged since the previous frame".
        chooser = self._graph.add("palettegen", "stats_mode=full:reserve_transparent=1")
        sink = self._graph.add("buffersink")
        source.link_to(chooser)
        chooser.link_to(sink)
        self._graph.configure()
        self.n_seen = 0

    def look(self, picture: VideoFrame) -> None:
        """Add a frame's colours to the statistics."""
        picture.pts, picture.time_base = self.n_seen, _HUNDREDTH
        self._graph.push(picture)
        self.n_seen += 1

    def palette(self) -> VideoFrame:
        """Return the palette; called once, after at least one frame."""
        self._graph.push(None)
        palette: VideoFrame = self._graph.pull()  # type: ignore[assignment]  # a video frame: the graph has no audio
        return palette


class PaletteUser:
    """Assigns a colour of a palette to each pixel (FFmpeg's ``paletteuse``).

    Parameters
    ----------
    library : module
        PyAV.
    size : (int, int)
        Width and height.
    time_base : Fraction
        Duration of a frame in seconds.
    palette : VideoFrame
        Result of a ``PaletteChooser``.
    """

    def __init__(
        self,
        library: ModuleType,
        size: tuple[int, int],
        time_base: Fraction,
        palette: VideoFrame,
    ) -> None:
        self._av, self._graph, self._time_base = library, library.filter.Graph(), time_base
        self._frames = self._graph.add_buffer(
            width=size[0], height=size[1], format="rgba", time_base=time_base
        )
        colors = self._graph.add_buffer(
            width=_PALETTE_SIDE,
            height=_PALETTE_SIDE,
            format=palette.format.name,
            time_base=time_base,
        )
        user = self._graph.add("paletteuse", "dither=bayer:bayer_scale=4:alpha_threshold=128")
        sink = self._graph.add("buffersink")
        self._frames.link_to(user, 0, 0)
        colors.link_to(user, 0, 1)
        user.link_to(sink)
        self._graph.configure()
        palette.pts, palette.time_base = 0, time_base
        colors.push(palette)
        colors.push(None)

    def taken(self, picture: VideoFrame | None) -> list[VideoFrame]:
        """Return the frames that are complete after this one; None ends the video."""
        if picture is not None:
            picture.time_base = self._time_base
        self._frames.push(picture)
        ready: list[VideoFrame] = []
        while True:
            try:
                done = self._graph.pull()
            except (self._av.BlockingIOError, self._av.EOFError):
                return ready
            # In 1/100 s; times are rounded, not durations, so errors do not accumulate.
            done.pts, done.time_base = round(100 * done.pts * done.time_base), _HUNDREDTH
            ready.append(done)
