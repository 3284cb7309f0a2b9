"""Feet in keyframed motions: what is style is a note, what cannot be style is a warning."""

from dataclasses import replace

import numpy as np
import pytest
from linting.sound import FRAMES, RATE, legs
from rigs.retargeting.trotting import trot

import viewer
from viewer.linting import Finding, Subject, lint_scene
from viewer.linting.feet import check as check_feet
from viewer.loading import bundled_body
from viewer.rigs.motion.transform_clip import Animation, TransformChannel, TransformClip
from viewer.rigs.scene import Actor, Scene

_K = np.arange(FRAMES)


def moved(paths: dict[int, np.ndarray]) -> list[Finding]:
    """Check legs whose joints are keyed in every frame, moved by (F, 3) from their rest places."""
    figure = legs()
    rest = figure.skeleton.rest_translations
    channels = tuple(
        TransformChannel(joint, "translation", _K / RATE, rest[joint] + path)
        for joint, path in paths.items()
    )
    clip = TransformClip("keys", channels, 0.0, (FRAMES - 1) / RATE)
    return [*check_feet(Subject(Actor(figure, clip=clip)))]


def along(axis: int, values: np.ndarray) -> np.ndarray:
    path = np.zeros((FRAMES, 3))
    path[:, axis] = values
    return path


def serious(findings: list[Finding]) -> list[str]:
    return [finding.code for finding in findings if finding.severity == "warning"]


@pytest.mark.parametrize("speed", [0.6, 0.25, 0.12])
@pytest.mark.parametrize("sways", [0.0, 0.02])
def test_body_that_skates_is_a_warning_however_slowly(speed, sways):
    # For 2 s, with both feet on the ground, which stand below 0.08 and swing above 0.2 times the
    # size of 1.6 m a second. The hips sway by 20 mm a second.
    sway = along(0, sways * np.sin(2.0 * np.pi * _K / RATE) / (2.0 * np.pi))
    skate = along(2, speed * _K / RATE)
    assert serious(moved({0: skate + sway, 3: -sway, 6: -sway})) == ["C007"]


def pace(start: int) -> np.ndarray:
    """Return the path of a foot that walks in place: 12 frames back at 1.5 m/s, 8 ahead, lifted."""
    frame = (_K + start) % 20
    swing = np.clip((frame - 12) / 8.0, 0.0, 1.0)
    ahead = np.where(frame < 12, 0.3 - 0.05 * frame, -0.3 + 0.6 * swing)
    return np.stack([0 * ahead, 0.15 * np.sin(np.pi * swing), ahead], axis=1)


@pytest.mark.parametrize(
    ("aside", "codes"),
    [
        (0.0 * _K, []),
        (0.3 * _K / RATE, ["C007"]),  # the ground seems to move aside with the body
        (1.4 * np.clip((_K - 22) / 15.0, 0.0, 1.0), ["C007"]),
    ],
)
def test_walk_in_place_that_glides_aside_is_a_warning(aside, codes):
    found = moved({0: along(0, aside), 3: pace(0), 6: pace(10)})
    assert serious(found) == codes


def test_standing_body_that_shifts_its_weight_does_not_skate():
    shift = along(2, 0.12 * _K / RATE)
    assert moved({0: shift, 3: -shift, 6: -shift}) == []


def test_foot_shifted_under_a_body_that_stays_is_a_note():
    (found,) = moved({3: along(2, 0.5 * _K / RATE)})
    assert (found.code, found.severity) == ("C007", "note")


@pytest.mark.parametrize("depth", [0.02, 0.05])
def test_body_that_stands_in_the_ground_is_a_warning(depth):
    sunk = np.where((_K >= 20) & (_K < 40), -depth, 0.0)
    assert serious(moved({0: along(1, sunk)})) == ["C008"]


def test_foot_that_dips_while_it_moves_is_a_note():
    # The lowest point, 40 mm or 4 % of the height, is passed at once.
    dip = np.interp(_K, [20, 25, 30], [0.0, -0.04, 0.0])
    (found,) = moved({3: along(1, dip)})
    assert (found.code, found.severity) == ("C008", "note")


@pytest.mark.parametrize("depth", [0.0, 0.03, 0.1])
def test_modelled_character_that_stands_in_the_ground_throughout_is_found(depth):
    # Its height is 1.7 m; 30 mm are less than 3 %.
    figure = viewer.load(bundled_body()).actors[0].figure
    keys = np.tile(figure.skeleton.rest_translations[0] - [0.0, depth, 0.0], (2, 1))
    channel = TransformChannel(0, "translation", [0.0, 2.0], keys)
    actor = Actor(figure, clip=TransformClip("keys", (channel,), 0.0, 2.0))
    found = [one for one in check_feet(Subject(actor)) if one.severity == "warning"]
    expected = ["C008.throughout"] if depth == 0.1 else []
    assert [one.diagnostic.key for one in found] == expected
    assert all(one.diagnostic.values["depth"] == "100 mm" for one in found)


@pytest.mark.parametrize("height", [0.03, 0.1, 0.5])
def test_modelled_character_that_hangs_in_the_air_throughout_is_found(height):
    # Who is half a metre above the ground stands on something.
    figure = viewer.load(bundled_body()).actors[0].figure
    keys = np.tile(figure.skeleton.rest_translations[0] + [0.0, height, 0.0], (2, 1))
    channel = TransformChannel(0, "translation", [0.0, 2.0], keys)
    actor = Actor(figure, clip=TransformClip("keys", (channel,), 0.0, 2.0))
    found = [one for one in check_feet(Subject(actor)) if one.severity == "warning"]
    assert [one.diagnostic.key for one in found] == ["C016.throughout"] * (height == 0.1)
    # The soles of its skin are 0.2 mm off the lowest point of its shape.
    heights = [float(one.diagnostic.values["height"].removesuffix(" mm")) for one in found]
    assert heights == pytest.approx([100.0] * len(found), abs=0.5)


@pytest.mark.parametrize(("bend", "codes"), [(0.0, ["C016.throughout"]), (90.0, [])])
def test_body_that_sits_does_not_hang_in_the_air(bend, codes):
    # Level thighs and upright shanks lift the soles as far as the body is raised otherwise.
    figure, half = viewer.load(bundled_body()).actors[0].figure, np.radians(0.5 * bend)
    skeleton = figure.skeleton
    hips, knees = ([skeleton.names.index(f"{side}_{part}") for side in ("left", "right")]
                   for part in ("hip", "knee"))  # fmt: skip
    thigh = -float(skeleton.rest_translations[knees[0], 1])
    lift = 0.0 if bend else thigh
    place = skeleton.rest_translations[0] + [0.0, lift, 0.0]
    channels = [TransformChannel(0, "translation", [0.0, 2.0], np.tile(place, (2, 1)))]
    for joints, sign in ((hips, -1.0), (knees, 1.0)):
        turn = np.tile([sign * np.sin(half), 0.0, 0.0, np.cos(half)], (2, 1))
        channels += [TransformChannel(joint, "rotation", [0.0, 2.0], turn) for joint in joints]
    actor = Actor(figure, clip=TransformClip("keys", tuple(channels), 0.0, 2.0))
    assert [one.diagnostic.key for one in check_feet(Subject(actor))] == codes


@pytest.mark.parametrize(("depth", "key"), [(0.1, "C013.no-height"), (0.3, "C008.throughout")])
def test_character_that_never_rests_is_in_the_ground_if_it_is_in_nearly_all_frames(depth, key):
    # It bobs by 0.1 m, so that its feet are up to 0.2 m below their lowest places, on no ground.
    figure, times = viewer.load(bundled_body()).actors[0].figure, _K / RATE
    heights = 0.1 * np.sin(2.0 * np.pi * 3.0 * times) - depth
    keys = figure.skeleton.rest_translations[0] + along(1, heights)
    channel = TransformChannel(0, "translation", times, keys)
    actor = Actor(figure, clip=TransformClip("keys", (channel,), 0.0, float(times[-1])))
    (found,) = check_feet(Subject(actor))
    assert found.diagnostic.key == key
    if depth == 0.3:  # nine tenths of a sine are below sin 72°
        expected = 0.3 - 0.1 * np.sin(np.radians(72.0))
        assert found.diagnostic.values["depth"] == f"{1000 * expected:.0f} mm"


@pytest.mark.parametrize(
    ("lean", "depth", "key"), [(90.0, 1.3, "C013.no-height"), (30.0, 0.5, "C008.throughout")]
)
def test_swimmer_is_not_in_the_ground_as_a_runner_is(lean, depth, key):
    # It bobs as above, and leans so that its legs are horizontal, or 13 % less high.
    figure, times = viewer.load(bundled_body()).actors[0].figure, _K / RATE
    heights = 0.1 * np.sin(2.0 * np.pi * 3.0 * times) - depth
    half = np.radians(0.5 * lean)
    channels = (
        ("translation", figure.skeleton.rest_translations[0] + along(1, heights)),
        ("rotation", np.tile([np.sin(half), 0.0, 0.0, np.cos(half)], (FRAMES, 1))),
    )
    keys = tuple(TransformChannel(0, path, times, values) for path, values in channels)
    actor = Actor(figure, clip=TransformClip("keys", keys, 0.0, float(times[-1])))
    (found,) = check_feet(Subject(actor))
    assert found.diagnostic.key == key


def test_notes_about_several_animations_are_one_line():
    """The figure plays two animations with a dip of one foot."""
    figure = legs()
    rest = figure.skeleton.rest_translations[3]
    path = along(1, np.interp(_K, [20, 25, 30], [0.0, -0.04, 0.0]))
    channel = TransformChannel(3, "translation", _K / RATE, rest + path)
    clip = TransformClip("dip", (channel,), 0.0, (FRAMES - 1) / RATE)
    names = ("walk", "run", "hop", "turn")
    animations = tuple(Animation(name, clip.start, clip.end, lambda: clip) for name in names)
    actor = Actor(replace(figure, animations=animations))
    (found,) = [one for one in lint_scene(Scene([actor])) if one.code == "C008"]
    assert found.motion == "walk, run, hop and 1 more"
    assert found.message.endswith("; first of 4")
    assert found.diagnostic.values["animations"] == list(names)


@pytest.mark.parametrize(
    ("velocity", "codes"),
    [
        ((0.0, 0.0, 0.0), []),  # the paws of the trot stand exactly
        ((0.3, 0.0, 0.0), ["C007.foot"]),  # slower than a paw swings: the animal is 0.45 m high
        ((0.0, -0.1, 0.0), ["C008.throughout"]),  # 0.1 m below the ground from the first frame
    ],
)
def test_feet_of_a_quadruped_are_checked(velocity, codes):
    motion = trot()
    clip, seconds = motion.clip, np.arange(motion.clip.n_rows) / motion.clip.timing.frame_rate
    path = np.where(np.array(velocity) < 0.0, velocity, np.outer(seconds, velocity))
    offsets = clip.translations.copy()
    offsets[:, 0] += path
    actor = Actor(motion.figure, clip=replace(clip, translations=offsets))
    found = [*check_feet(Subject(actor, up=motion.figure.up))]
    assert [one.diagnostic.key for one in found if one.severity == "warning"] == codes
