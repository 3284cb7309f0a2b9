"""Video output with PyAV (FFmpeg's libraries), which is imported only when needed.

``.mp4`` contains H.264, ``.webm`` VP9, ``.gif`` 256-colour images. Colours of the first two are
those of BT.709 in limited range, converted and tagged as such (ITU-T H.273, tables 2 to 4, code
point 1), so that players show the rendered colours.

A GIF has one palette for the whole video, chosen from a few frames: static regions are then
identical from frame to frame and not stored again, which makes the file five times smaller than
with a palette per frame. The dither is ordered (a fixed pattern) for the same reason.
"""

from __future__ import annotations

import contextlib
import io
from fractions import Fraction
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from viewer.errors import OutputError, ViewerError
from viewer.media.saving import Replacement
from viewer.media.video_kinds import MOST_GIF_RATE, QUALITY, VideoKind, video_kind
from viewer.phrases import printable
from viewer.rigs.arrays import Bytes

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import av
    from av.filter.graph import Graph
    from av.video.frame import VideoFrame

_BT709, _LIMITED = 1, 1  # H.273's code points; FFmpeg's AVColorSpace and AVColorRange
_GIF_SAMPLES = 12  # number of frames from which the palette is chosen

_HUNDREDTH = Fraction(1, 100)  # seconds, the time unit of GIF
_PALETTE_SIDE = 16  # FFmpeg stores a palette as an image of 16 x 16


class VideoSink:
    """Writes frames as a video; a sink of ``viewer.rendering.recorder``.

    ``n_samples``: number of frames that should be passed to ``look`` first. ``rate``: frames per
    second. ``quality``: 0 to 100; ignored for GIFs. ``transparent``: whether frames have
    transparent pixels; if the format has no alpha, they are composited on black.
    """

    n_kept = 0

    def __init__(
        self,
        path: Path,
        size: tuple[int, int],
        rate: float,
        quality: float = QUALITY,
        transparent: bool = False,
    ) -> None:
        self.path, self.size, self.workers, self.n_bytes = path, size, 1, 0
        self._kind = video_kind(path)
        self._av = _library()
        self.encoder = _first_encoder(self._av, self._kind, path)
        if not 0.0 <= quality <= 100.0:
            raise ViewerError(f"video quality: expected 0 to 100, found {quality:g}")
        most = MOST_GIF_RATE if path.suffix.lower() == ".gif" else 1000.0
        if not 0.01 <= rate <= most:
            raise ViewerError(
                f"{printable(path, 300)}: expected 0.01 to {most:g} frames per second, "
                f"found {rate:g}"
            )
        self.rate, self._quality = Fraction(rate).limit_denominator(1001), quality
        self.notes: list[str] = []
        self._has_alpha = transparent and self._kind.has_alpha
        self._may_blend = not self._has_alpha and (transparent or self.encoder == "gif")
        odd = (size[0] % 2, size[1] % 2) if self._kind.needs_even else (0, 0)
        self._coded = size[0] + odd[0], size[1] + odd[1]
        self._note(transparent)
        self._file = Replacement(path)
        self._output: VideoFile | None = None
        self._problem: OutputError | None = None
        self._container: av.container.OutputContainer | None = None
        self._stream: Any = None
        self.n_samples = _GIF_SAMPLES if self.encoder == "gif" else 0
        self._chooser: _PaletteChooser | None = None
        self._palette: _PaletteUser | None = None

    def _note(self, transparent: bool) -> None:
        name, rate = printable(self.path), float(self.rate)
        if transparent and not self._has_alpha:
            self.notes.append(f"{name}: this format has no transparency; composited on black")
        if self._coded != self.size:
            (width, height), (wide, high) = self.size, self._coded
            self.notes.append(
                f"{name}: this format needs even dimensions; the last column or row is repeated: "
                f"{width} x {height} becomes {wide} x {high}"
            )
        if self.encoder == "gif" and 100 % rate:
            low = int(100 / rate)
            self.notes.append(
                f"{name}: GIF frame delays are multiples of 0.01 s; frames last "
                f"{low / 100:g} or {(low + 1) / 100:g} s, "
                f"{rate:g} frames per second on average"
            )

    def look(self, pixels: Bytes) -> None:
        """Add a frame's colours to the palette; only for GIFs, before any frame is written."""
        if self._chooser is None:
            self._chooser = _PaletteChooser(self._av, self._coded)
        self._chooser.look(self._picture(pixels))

    def write(self, frame: int, pixels: Bytes) -> None:
        """Encode one frame, in order; an error is raised again for every later frame."""
        with self._errors():
            if self._container is None:
                if self.encoder == "gif" and self._chooser is None:
                    self.look(pixels)  # a palette of one frame is better than none
                self._open()
            picture = self._picture(pixels)
            picture.pts, picture.time_base = frame, 1 / self.rate
            self._encode(self._converted(picture))

    def close(self) -> None:
        """Finish the video and replace the target, which is unchanged if that fails."""
        # Opened for the first frame.
        assert self._container is not None and self._output is not None
        with self._errors():
            if self._palette is not None:
                self._encode(self._palette.taken(None))
            self._container.mux(self._stream.encode(None))
            self._container.close()
            self._output.finish()
        self._container = None
        self.n_bytes = self._file.commit(in_any_thread=True)

    def abort(self) -> None:
        """Remove the unfinished file."""
        if self._output is not None:
            self._output.drop()
        if self._container is not None:
            # The file is discarded anyway, usually because the disk is full.
            with contextlib.suppress(OSError, ValueError, self._av.FFmpegError):
                self._container.close()
            self._container = None
        self._file.discard()

    @contextlib.contextmanager
    def _errors(self) -> Iterator[None]:
        """Convert the first error to one line, and raise it again in later calls."""
        if self._problem is not None:
            raise self._problem
        try:
            yield
            if self._output is not None and self._output.problem is not None:
                raise self._output.problem
        except (OSError, ValueError, self._av.FFmpegError) as problem:
            # The library's error is often only a consequence of an earlier file error.
            first = self._output.problem if self._output is not None else None
            self._problem = self._file.error(first or problem)
            raise self._problem from None
        except OutputError as problem:
            self._problem = problem
            raise

    def _open(self) -> None:
        temporary = self._file.begin()
        format_name = temporary.suffix.lower()[1:]
        muxer = dict(self._kind.muxer)
        if self.encoder == "gif":
            muxer["final_delay"] = str(round(100 / self.rate))  # 1/100 s
        self._output = VideoFile(temporary)
        self._container = self._av.open(
            self._output, "w", format=format_name, options=muxer, io_open=self._output.reopen
        )
        rate = Fraction(100) if self.encoder == "gif" else self.rate
        options = _encoder_options(self.encoder, self._quality)
        stream: Any = self._container.add_stream(self.encoder, rate=rate, options=options)
        stream.width, stream.height = self._coded
        stream.pix_fmt = "pal8" if self.encoder == "gif" else self._pixel_format
        context = stream.codec_context
        context.thread_count = 0  # 0: one thread per processor
        if self._chooser is not None:
            context.time_base = Fraction(1, 100)
            palette = self._chooser.palette()
            self._palette = _PaletteUser(self._av, self._coded, 1 / self.rate, palette)
        else:
            context.time_base = 1 / self.rate
            context.color_range, context.colorspace = _LIMITED, _BT709
            context.color_primaries, context.color_trc = _BT709, _BT709
        if self.encoder in ("libopenh264", "mpeg4"):
            context.bit_rate = _bit_rate(self._coded, float(self.rate), self._quality)
        self._stream, self._reformatter = stream, self._av.video.reformatter.VideoReformatter()

    @property
    def _pixel_format(self) -> str:
        return "yuva420p" if self._has_alpha else "yuv420p"

    def _picture(self, pixels: Bytes) -> VideoFrame:
        """Return the pixels in FFmpeg's memory, with repeated edges if the size must be even."""
        # Its scaler may read 16 bytes beyond the pixels (AVFrame.data), so they must be copied.
        (wide, high), (height, width) = self._coded, pixels.shape[:2]
        picture: VideoFrame = self._av.VideoFrame(wide, high, "rgba")
        plane = picture.planes[0]
        rows = np.frombuffer(memoryview(plane), dtype=np.uint8).reshape(high, plane.line_size)
        rgba = rows[:, : 4 * wide].reshape(high, wide, 4)
        rgba[:height, :width] = pixels
        rgba[:height, width:] = pixels[:, -1:]
        rgba[height:] = rgba[height - 1]
        if self._may_blend and (pixels[..., 3] < 255).any():
            alpha = rgba[..., 3:].astype(np.uint16)
            rgba[..., :3] = (rgba[..., :3] * alpha + 127) // 255
            rgba[..., 3] = 255
        return picture

    def _converted(self, picture: VideoFrame) -> Iterable[VideoFrame]:
        if self._palette is not None:
            return self._palette.taken(picture)
        return [
            self._reformatter.reformat(
                picture,
                format=self._pixel_format,
                dst_colorspace=_BT709,
                dst_color_range=_LIMITED,
                threads=1,  # the encoder already uses all processors
            )
        ]

    def _encode(self, pictures: Iterable[VideoFrame]) -> None:
        assert self._container is not None  # opened by write()
        for picture in pictures:
            self._container.mux(self._stream.encode(picture))


def _library() -> ModuleType:
    try:
        import av
        import av.filter
        import av.video.reformatter
    except ImportError:
        raise ViewerError("videos need PyAV, which is not installed: pip install av") from None
    return av


def _first_encoder(library: ModuleType, kind: VideoKind, path: Path) -> str:
    for name in kind.encoders:
        try:
            library.Codec(name, "w")
        except library.codec.codec.UnknownCodecError:
            continue
        return name
    wanted = " or ".join(kind.encoders)
    raise ViewerError(
        f"{printable(path, 300)}: the installed PyAV has no encoder for {kind.title}: {wanted}"
    )


def _encoder_options(encoder: str, quality: float) -> dict[str, str]:
    """Return an encoder's options for a quality from 0 to 100."""
    if encoder == "libx264":
        return {"preset": "veryfast", "crf": f"{51.0 - 0.43 * quality:.1f}"}  # 75: 18.8
    if encoder == "libvpx-vp9":
        speed = {"deadline": "good", "cpu-used": "5", "row-mt": "1", "auto-alt-ref": "0"}
        return {"crf": f"{63.0 - 0.5 * quality:.0f}", "b": "0", **speed}  # 75: 26
    return {}


def _bit_rate(size: tuple[int, int], rate: float, quality: float) -> int:
    """Return bits per second for encoders without a quality setting: 0.02 to 0.6 per pixel."""
    return int(size[0] * size[1] * rate * 0.02 * 30.0 ** (quality / 100.0))


class VideoFile:
    """A seekable file object for PyAV that drops everything after the first error."""

    # FFmpeg hides write errors, and libavformat does not survive every failed write: if the header
    # could not be written, the next packet makes PyAV write it again, and ``avformat_init_output``
    # reads freed memory. So writes always succeed for the library, and the owner of the file checks
    # for an error after each step.

    def __init__(self, path: Path) -> None:
        self.name, self.problem, self.closed = str(path), None, False
        self._path = path
        self._file: io.RawIOBase = path.open("r+b", buffering=0)
        self._place = self._size = 0

    problem: OSError | None
    """First error."""

    def write(self, data: bytes) -> int:
        """Write all bytes, or drop them after an error; success is reported either way."""
        if self.problem is None and not self.closed:
            try:
                self._write_all(data)
            except OSError as problem:
                self.problem = problem
        self._place += len(data)
        self._size = max(self._size, self._place)
        return len(data)

    def _write_all(self, data: bytes) -> None:
        self._file.seek(self._place)
        rest = memoryview(data)
        while rest:
            # A nearly full disk accepts a part of the bytes, and only the next call fails.
            rest = rest[self._file.write(rest) or 0 :]

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Change the position, as ``io.IOBase.seek``; takes effect at the next write."""
        base = {io.SEEK_SET: 0, io.SEEK_CUR: self._place, io.SEEK_END: self._size}[whence]
        self._place = base + offset
        return self._place

    def tell(self) -> int:
        """Return the position of the next write."""
        return self._place

    def reopen(self, url: str, flags: int, options: dict[str, str]) -> BinaryIO:
        """Open the same file for reading, which FFmpeg does to move MP4's index to the front."""
        return self._path.open("rb")

    def finish(self) -> None:
        """Close the file; raise the first ``OSError``, possibly from closing it."""
        self.closed = True
        try:
            self._file.close()
        except OSError as problem:
            self.problem = self.problem or problem
        if self.problem is not None:
            raise self.problem

    def drop(self) -> None:
        """Close the file of a discarded video."""
        self.closed = True
        with contextlib.suppress(OSError):
            self._file.close()


class _PaletteChooser:
    """Chooses colours by median cut over some frames (FFmpeg's ``palettegen``)."""

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


class _PaletteUser:
    """Assigns a colour of a palette to each pixel (FFmpeg's ``paletteuse``)."""

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
