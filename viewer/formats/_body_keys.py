"""Keys that stand beside the parameters of a body: its gender, its model, and the frame rate."""

from __future__ import annotations

from collections.abc import Iterable

from viewer.diagnostics import wording
from viewer.formats._archive.checking import finite
from viewer.formats._archive.values import Archive, Value, describe, texts_in
from viewer.phrases import Remedy, listed, printable
from viewer.rigs.bodies.smpl_family import gender_of, model_title
from viewer.rigs.motion.timing import FASTEST, SLOWEST, is_rate

GENDERS = ("gender", "genders")
MODELS = ("surface_model_type", "model_type", "body_model", "smpl_type", "model")
RATES = (
    *("mocap_framerate", "mocap_frame_rate", "fps", "frame_rate", "frameRate", "framerate"),
    *("video_fps", "frames_per_second"),
)
RATE_REMEDY = Remedy("Frames per second in the Timeline sets it", "--fps sets it")
GENDER_REMEDY = Remedy("open the model of the right gender first", "--gender sets it")
_MOST_SCALED = 1e6  # maximum scale of a body; AIST++ scales by about 100


def gender_in(value: Value) -> tuple[str, str]:
    """Return the gender that a value states, also once for each frame; else what it states.

    >>> gender_in(b"F"), gender_in(["female", "male", "male"])
    (('female', ''), ('', 'female, male'))
    """
    said = [text for text in texts_in(value) if text.strip()]
    found = {gender_of(text) for text in said}
    if len(found) == 1 and "" not in found:
        return found.pop(), ""
    if said:
        return "", printable(", ".join([*dict.fromkeys(map(str.strip, said))][:3]), 60)
    is_left_open = value is None or texts_in(value) or value == [] or value == [None]
    return "", "" if is_left_open else str(describe(value))


def model_in(values: Iterable[Value]) -> str:
    """Return the title of the first model of the family that values state; empty for none."""
    titles = (model_title(text) for value in values for text in texts_in(value)[:1])
    return next(filter(None, titles), "")


def single(archive: Archive, key: str) -> float:
    """Return a single finite number, which may be an array of one."""
    values = archive.array(key).values().ravel()
    if len(values) != 1:
        raise archive.fault(wording.MOTION_SINGLE, item=key, found=len(values))
    return float(finite(archive, key, values)[0])


def rate_in(archive: Archive) -> float | None:
    """Return the frame rate that an archive states first, None if it states none."""
    rates = {key: single(archive, key) for key in RATES if archive.has(key)}
    for key, rate in rates.items():
        if not is_rate(rate):
            raise archive.fault(
                "F002.motion-rate: {item}: expected {low:g} to {high:,.0f} frames per second, "
                "found {found:g}",
                item=key,
                low=SLOWEST,
                high=FASTEST,
                found=rate,
            )
    if len(set(rates.values())) > 1:
        archive.source.warn(
            wording.MOTION_RATES, rates=listed([f"{key} {rate:g}" for key, rate in rates.items()])
        )
    return next(iter(rates.values()), None)


def scale_in(archive: Archive, key: str) -> float:
    """Return a plausible scale of a body, by which AIST++ multiplies positions in metres."""
    scale = single(archive, key)
    low, high = 1.0 / _MOST_SCALED, _MOST_SCALED
    if not low <= scale <= high:
        raise archive.fault(
            "F002.motion-scale: {item}: expected {low:g} to {high:g}, found {found:g}",
            item=key,
            low=low,
            high=high,
            found=scale,
        )
    return scale
