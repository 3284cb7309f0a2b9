"""The 256 colours of a GIF: chosen from a few frames, then used for all with a still dither.

One palette for the whole video leaves what does not move unchanged from frame to frame, so that it
need not be stored again: a fifth of the size that a palette for each frame takes. The dither is
ordered (a pattern that stands still), for the same reason.
"""

from __future__ import annotations

from fractions import Fraction
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from av.filter.graph import Graph
    from av.video.frame import VideoFrame

__all__ = ["PaletteChooser", "PaletteUser"]

_HUNDREDTH = Fraction(1, 100)  # of a second, in which a GIF counts
_PALETTE_SIDE = 16  # FFmpeg holds a palette as a picture of 16 x 16


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
        # One colour stands for transparent, and for "as in the frame before".
        chooser = self._graph.add("palettegen", "stats_mode=full:reserve_transparent=1")
        sink = self._graph.add("buffersink")
        source.link_to(chooser)
        chooser.link_to(sink)
        self._graph.configure()
        self.n_seen = 0

    def look(self, picture: VideoFrame) -> None:
        """Take a frame's colours into account."""
        picture.pts, picture.time_base = self.n_seen, _HUNDREDTH
        self._graph.push(picture)
        self.n_seen += 1

    def palette(self) -> VideoFrame:
        """Return the colours; called once, after at least one frame."""
        self._graph.push(None)
        palette: VideoFrame = self._graph.pull()  # type: ignore[assignment]  # no sound in here
        return palette


class PaletteUser:
    """Gives each pixel a colour of a palette (FFmpeg's ``paletteuse``).

    Parameters
    ----------
    library : module
        PyAV.
    size : (int, int)
        Width and height.
    time_base : Fraction
        Seconds that a frame stays.
    palette : VideoFrame
        Of a ``PaletteChooser``.
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
        """Return the frames that are ready once this one is in; None ends the video."""
        if picture is not None:
            picture.time_base = self._time_base
        self._frames.push(picture)
        ready: list[VideoFrame] = []
        while True:
            try:
                done = self._graph.pull()
            except (self._av.BlockingIOError, self._av.EOFError):
                return ready
            # Delays in 1/100 s, rounded so that no error adds up.
            done.pts, done.time_base = round(100 * done.pts * done.time_base), _HUNDREDTH
            ready.append(done)
