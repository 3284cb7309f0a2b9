"""Round trips of videos: colours, sizes, rates and transparency."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from media.small_videos import counting, decoded, write
from PIL import Image

from viewer.media import video_kinds
from viewer.media.video import VideoSink

pytestmark = pytest.mark.slow
av = pytest.importorskip("av")
COLORS = {"red": (220, 40, 30), "green": (30, 170, 60), "blue": (40, 60, 200), "gray": (128,) * 3}


def quarters(width: int, height: int) -> np.ndarray:
    """Return four colours, one in each quarter."""
    pixels = np.full((height, width, 4), 255, dtype=np.uint8)
    half, middle = height // 2, width // 2
    pixels[:half, :middle, :3], pixels[:half, middle:, :3] = COLORS["red"], COLORS["green"]
    pixels[half:, :middle, :3], pixels[half:, middle:, :3] = COLORS["blue"], COLORS["gray"]
    return pixels


@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".gif"])
def test_colours_round_trip(tmp_path, suffix):
    path = tmp_path / f"x{suffix}"
    write(VideoSink(path, (64, 48), 25.0), [quarters(64, 48)] * 5)
    frames = decoded(path)
    assert len(frames) == 5
    middles = [frames[2][12, 16], frames[2][12, 48], frames[2][36, 16], frames[2][36, 48]]
    # The tolerance covers rounding to 8 bits of limited range, twice, and the loss of the encoder.
    assert np.abs(np.array(middles, dtype=int) - list(COLORS.values())).max() <= 3


def test_colours_are_those_of_bt709(tmp_path):
    """ITU-R BT.709-6, 3.2 and 3.4: Y = 16 + 219 (0.2126 R + 0.7152 G + 0.0722 B), and so on."""
    path = tmp_path / "x.mp4"
    pixels = np.full((48, 64, 4), (220, 40, 30, 255), dtype=np.uint8)
    write(VideoSink(path, (64, 48), 25.0, quality=100), [pixels])
    with av.open(str(path)) as container:
        frame = next(container.decode(video=0))
        context = container.streams.video[0].codec_context
        tags = context.colorspace, context.color_primaries, context.color_trc, context.color_range
    planes = [
        np.frombuffer(memoryview(plane), dtype=np.uint8).reshape(plane.height, plane.line_size)
        for plane in frame.planes
    ]
    red, green, blue = np.array([220, 40, 30]) / 255.0
    luma = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    wanted = 16 + 219 * luma, 128 + 224 * (blue - luma) / 1.8556, 128 + 224 * (red - luma) / 1.5748
    found = planes[0][24, 32], planes[1][12, 16], planes[2][12, 16]
    np.testing.assert_allclose(found, wanted, atol=1.5)  # 8-bit steps
    assert [int(tag) for tag in tags] == [1, 1, 1, 1]


@pytest.mark.parametrize(
    ("rate", "exact"),
    [
        (30.0, Fraction(30)),
        (23.976024, Fraction(24000, 1001)),
        (12.5, Fraction(25, 2)),
        (120.0, Fraction(120)),
    ],
)
def test_rate_and_order_of_frames_are_preserved(tmp_path, rate, exact):
    path = tmp_path / "x.mp4"
    write(VideoSink(path, (64, 48), rate), [counting(frame) for frame in range(12)])
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        frames = list(container.decode(stream))
    assert stream.average_rate == exact
    assert [frame.pts * frame.time_base for frame in frames] == [n / exact for n in range(12)]
    grays = [frame.to_ndarray(format="rgb24").mean() for frame in frames]
    np.testing.assert_allclose(grays, 20.0 * np.arange(12), atol=3.0)


@pytest.mark.parametrize("suffix", [".mp4", ".webm"])
def test_odd_sizes_are_padded_by_repeating_the_last_column_and_row(tmp_path, suffix):
    path = tmp_path / f"x{suffix}"
    pixels = np.full((31, 33, 4), 255, dtype=np.uint8)
    pixels[:, 32, :3], pixels[30, :, :3] = (200, 0, 0), (0, 0, 200)
    sink = VideoSink(path, (33, 31), 25.0, quality=100)
    assert sink.notes == [
        f"{path}: this format needs even dimensions; the last column or row is repeated: "
        "33 x 31 becomes 34 x 32"
    ]
    write(sink, [pixels])
    frame = decoded(path)[0].astype(int)
    assert frame.shape == (32, 34, 3)
    assert frame[10, 33, 0] > 150 and frame[10, 33, 2] < 60
    assert frame[31, 10, 2] > 150 and frame[31, 10, 0] < 60


def test_gif_keeps_odd_sizes(tmp_path):
    sink = VideoSink(tmp_path / "x.gif", (33, 31), 25.0)
    write(sink, [counting(1, (33, 31))])
    assert sink.notes == [] and decoded(tmp_path / "x.gif")[0].shape == (31, 33, 3)


def test_webm_preserves_transparency(tmp_path):
    path = tmp_path / "x.webm"
    pixels = quarters(64, 48)
    pixels[:24, :32, 3], pixels[24:, 32:, 3] = 0, 100
    sink = VideoSink(path, (64, 48), 25.0, transparent=True)
    write(sink, [pixels] * 2)
    assert sink.notes == []
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert stream.metadata["alpha_mode"] == "1"
        # FFmpeg's built-in decoder drops alpha; that of libvpx does not.
        decoder = av.CodecContext.create("libvpx-vp9", "r")
        packets = [packet for packet in container.demux(stream) if packet.size]
        frames = [frame for packet in packets for frame in decoder.decode(packet)]
    plane = frames[0].planes[3]
    alpha = np.frombuffer(memoryview(plane), dtype=np.uint8).reshape(plane.height, plane.line_size)
    found = alpha[12, 16], alpha[12, 48], alpha[36, 16], alpha[36, 48]
    np.testing.assert_allclose(found, (0, 255, 255, 100), atol=3)


def test_gif_preserves_transparency(tmp_path):
    path = tmp_path / "x.gif"
    pixels = quarters(64, 48)
    pixels[:24, :32, 3] = 0
    moved = pixels[::-1]
    write(VideoSink(path, (64, 48), 25.0, transparent=True), [pixels, moved])
    with Image.open(path) as picture:
        first = np.array(picture.convert("RGBA"))
        picture.seek(1)
        second = np.array(picture.convert("RGBA"))
    assert first[12, 16, 3] == 0 and (first[12, 48], first[36, 16])[0][3] == 255
    # The content of the first frame is cleared there.
    assert second[36, 16, 3] == 0 and second[12, 16, 3] == 255


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_opaque_formats_composite_transparent_pixels_on_black(tmp_path, suffix):
    path = tmp_path / f"x{suffix}"
    pixels = quarters(64, 48)
    pixels[:24, :, 3], pixels[24:, :32, 3] = 0, 128
    wants = suffix == ".mp4"
    sink = VideoSink(path, (64, 48), 25.0, transparent=wants)
    said = f"{path}: this format has no transparency; composited on black"
    assert sink.notes == [said] * wants
    write(sink, [pixels])
    frame = decoded(path)[0].astype(int)
    assert frame[12, 16].max() <= 4
    np.testing.assert_allclose(frame[36, 16], np.array(COLORS["blue"]) * 128 / 255, atol=4)


def delays(path: Path) -> list[int]:
    """Return the frame delays of a GIF in 1/100 s, without a decoder (GIF89a, 23.c.vi)."""
    data, found, place = path.read_bytes(), [], 0
    while (place := data.find(b"\x21\xf9\x04", place)) >= 0:
        found.append(int.from_bytes(data[place + 4 : place + 6], "little"))
        place += 8
    return found


@pytest.mark.parametrize(
    ("rate", "wanted", "words"),
    [
        (25.0, [4] * 6, ""),
        (50.0, [2] * 6, ""),
        (30.0, [3, 4, 3, 3, 4, 3], "frames last 0.03 or 0.04 s, 30 frames per second on average"),
        (24.0, [4, 4, 4, 5, 4, 4], "frames last 0.04 or 0.05 s, 24 frames per second on average"),
    ],
)
def test_gif_delays_are_correct_on_average(tmp_path, rate, wanted, words):
    path = tmp_path / "x.gif"
    sink = VideoSink(path, (64, 48), rate)
    write(sink, [counting(frame) for frame in range(6)])
    note = f"{path}: GIF frame delays are multiples of 0.01 s; {words}"
    assert sink.notes == ([note] if words else [])
    assert delays(path) == wanted


def test_gif_colours_come_from_all_sampled_frames(tmp_path):
    path = tmp_path / "x.gif"
    sink = VideoSink(path, (64, 48), 10.0)
    first, last = np.zeros((48, 64, 4), np.uint8), quarters(64, 48)
    first[..., 3] = 255
    for pixels in (first, last):
        sink.look(pixels)
    write(sink, [first, last])
    frame = decoded(path)[1].astype(int)
    assert np.abs(frame[12, 16] - COLORS["red"]).max() <= 3


@pytest.mark.parametrize("transparent", [False, True])
def test_gif_of_gradients_with_a_moving_bar_is_correct_in_every_frame(tmp_path, transparent):
    """Most pixels do not change between frames and are not stored again."""
    path = tmp_path / "x.gif"
    x, y = np.meshgrid(np.linspace(60, 220, 96), np.linspace(80, 240, 64))
    still = np.stack([x, (x + y) / 2, y, np.full_like(x, 255)], axis=-1).astype(np.uint8)
    still[::9] = (40, 45, 50, 255)
    if transparent:
        still[:, 70:] = 0
    frames = []
    for frame in range(8):
        pixels = still.copy()
        pixels[20:50, 10 * frame : 10 * frame + 6] = (200, 30, 20, 255)
        if not transparent:  # enough colours to fill the palette
            noise = np.random.default_rng(frame).integers(0, 255, (4, 20, 3))
            pixels[30:34, 40:60, :3] = noise
        frames.append(pixels)
    sink = VideoSink(path, (96, 64), 20.0, transparent=transparent)
    for pixels in frames:
        sink.look(pixels)
    write(sink, frames)
    with Image.open(path) as animation:
        for index, pixels in enumerate(frames):
            animation.seek(index)
            shown = np.array(animation.convert("RGBA")).astype(int)
            assert (shown[..., 3] == pixels[..., 3]).all(), index
            error = np.abs(shown - pixels)[pixels[..., 3] == 255].max(axis=-1)
            # The tolerance covers ordered dithering and noise; 80 pixels hardly affect the palette.
            assert error.mean() <= 6 and (error > 60).sum() <= 40, index


def test_higher_quality_is_larger_and_more_accurate(tmp_path):
    noise = np.random.default_rng(3).integers(0, 255, (64, 96, 4), dtype=np.uint8)
    noise[..., 3] = 255
    errors, sizes = [], []
    for quality in (10.0, 60.0, 100.0):
        path = tmp_path / f"{quality}.mp4"
        sink = VideoSink(path, (96, 64), 25.0, quality)
        write(sink, [noise] * 4)
        errors.append(np.abs(decoded(path)[1].astype(int) - noise[..., :3]).mean())
        sizes.append(sink.n_bytes)
        assert sink.n_bytes == path.stat().st_size
    assert sizes == sorted(sizes) and errors == sorted(errors, reverse=True)


def test_fallback_encoder_works(tmp_path, monkeypatch):
    kind = video_kinds.VideoKind("MP4 video (H.264)", ("no_such", "mpeg4"), False, True)
    monkeypatch.setitem(video_kinds.VIDEOS, ".mp4", kind)
    path = tmp_path / "x.mp4"
    sink = VideoSink(path, (64, 48), 25.0)
    write(sink, [quarters(64, 48)] * 3)
    assert sink.encoder == "mpeg4"
    # Its quality is lower.
    assert np.abs(decoded(path)[1][12, 16].astype(int) - COLORS["red"]).max() <= 12
