"""The .anim reader and writer: grammar, quirks, and messages."""

import numpy as np
import pytest
from faults import Fault, fault_of, refusal_of, warnings_of
from formats.synthetic_smpl import model

from viewer.errors import FormatError, RigError, UnsupportedFormatError
from viewer.formats import Source, detect, read, write
from viewer.loading import load
from viewer.rigs.figure import Figure
from viewer.rigs.motion.clip import Channel, Clip

ONE = "channel { extrapolate cycle bounce keys 2 { 0 1 flat smooth 2 3 linear -0.5 } }"
GOOD = f"animation {{ range -1 4 numchannels 1 {ONE} }}"


def parse(text: str) -> tuple[Clip, list[Fault]]:
    source = Source("walk.anim", text.encode())
    clip = read(source)
    assert isinstance(clip, Clip)
    return clip, warnings_of(source.diagnostics)


SKEL = "balljoint root { offset 0 0 0 }"


def test_all_values_are_read():
    clip, warnings = parse(GOOD)
    assert (clip.name, clip.start, clip.end, warnings) == ("walk", -1.0, 4.0, [])
    (channel,) = clip.channels
    assert channel.extrapolation == ("cycle", "bounce")
    assert channel.tangents == (("flat", "smooth"), ("linear", -0.5))
    np.testing.assert_array_equal(channel.times, [0, 2])
    np.testing.assert_array_equal(channel.values, [1, 3])


@pytest.mark.parametrize(
    "text",
    [
        GOOD.replace(" ", "\r\n"),
        GOOD.replace(" ", "\r"),
        GOOD.replace(" ", "\t"),
        GOOD.replace("channel {", "channel 14{"),
        GOOD.replace(" {", "{"),
        "\ufeff" + GOOD,
    ],
    ids=["crlf", "cr", "tabs", "numbered", "glued", "byte order mark"],
)
def test_quirks_load_without_warnings(text):
    clip, warnings = parse(text)
    assert len(clip.channels) == 1 and warnings == []


def test_clip_round_trips(tmp_path):
    clip, _ = parse(GOOD)
    write(clip, tmp_path / "copy.anim")
    again = read(Source.open(tmp_path / "copy.anim"))
    assert isinstance(again, Clip)
    assert (again.start, again.end) == (clip.start, clip.end)
    for old, new in zip(clip.channels, again.channels, strict=True):
        np.testing.assert_array_equal(old.times, new.times)
        np.testing.assert_array_equal(old.values, new.values)
        assert (old.tangents, old.extrapolation) == (new.tangents, new.extrapolation)


def test_tangents_may_mix_rules_and_slopes_on_both_sides():
    keys = "0 1 13.7 -0.22 1 2 flat -.75 2 3 +1e-1 linear 3 4 smooth 5."
    channel = f"channel {{ extrapolate linear cycle keys 4 {{ {keys} }} }}"
    clip, warnings = parse(f"animation {{ range 0 1 numchannels 1 {channel} }}")
    assert warnings == []
    assert clip.channels[0].tangents == (
        (13.7, -0.22),
        ("flat", -0.75),
        (0.1, "linear"),
        ("smooth", 5.0),
    )


def test_range_may_differ_from_the_keys_and_between_channels():
    channels = (
        "channel 0{extrapolate constant cycle keys 2{-1 1 flat flat 1 2 flat flat}}"
        "channel 1{extrapolate linear bounce keys 1{2 7 flat flat}}"
    )
    clip, warnings = parse(f"animation{{range 0 4 numchannels 2 {channels}}}")
    assert warnings == [] and (clip.start, clip.end) == (0.0, 4.0)
    assert [channel.times.tolist() for channel in clip.channels] == [[-1.0, 1.0], [2.0]]
    assert [channel.target for channel in clip.channels] == [0, 1]


def test_keys_at_the_same_time_are_both_kept():
    clip, warnings = parse(GOOD.replace("{ 0 1", "{ 2 1"))
    assert warnings == [] and clip.channels[0].times.tolist() == [2.0, 2.0]


def test_reversed_range_is_swapped_with_a_warning():
    clip, warnings = parse(GOOD.replace("range -1 4", "range 4 -1"))
    assert (clip.start, clip.end) == (-1.0, 4.0)
    assert warnings == [("F007.anim-reversed", 1, {"start": "-1", "end": "4"})]


def test_text_after_the_animation_is_ignored_with_a_warning():
    assert parse(f"{GOOD} more")[1] == [("F006.anim-after", 1, {"found": b"more"})]


def test_missing_range_is_taken_from_the_keys():
    clip, warnings = parse(GOOD.replace("range -1 4 ", ""))
    assert (clip.start, clip.end) == (0.0, 2.0)
    assert warnings == [("F007.anim-no-range", None, {"start": "0", "end": "2"})]


def test_numpy_scalars_are_written_as_numbers(tmp_path):
    tangents = ((np.float64(0.1), "flat"),)
    channel = Channel(0, np.array([1 / 3]), np.array([2 / 3]), tangents)
    write(Clip("c", (channel,), np.float64(0.1), np.float64(1e-17 + 0.3)), tmp_path / "c.anim")
    assert " ".join((tmp_path / "c.anim").read_text().split()) == (
        "animation { range 0.1 0.3 numchannels 1 channel { extrapolate constant constant "
        "keys 1 { 0.3333333333333333 0.6666666666666666 0.1 flat } } }"
    )


def test_write_refuses_channels_out_of_order(tmp_path):
    channel = Channel(3, np.zeros(1), np.zeros(1), (("flat", "flat"),))
    clip = Clip("odd", (channel,), 0, 1)
    with pytest.raises(UnsupportedFormatError) as caught:
        write(clip, tmp_path / "odd.anim")
    assert fault_of(caught.value.diagnostic) == ("F002.anim-order", None, {})


def test_write_refuses_a_figure(tmp_path):
    figure = read(Source("a.skel", SKEL.encode()))
    assert isinstance(figure, Figure)
    with pytest.raises(UnsupportedFormatError) as caught:
        write(figure, tmp_path / "a.anim")
    assert fault_of(caught.value.diagnostic) == ("F002.anim-figure", None, {})


def test_clip_is_recognised_by_content():
    assert detect(Source("walk.txt", GOOD.encode())) == "anim"


def test_clip_of_another_skeleton_is_refused_with_both_dof_counts(tmp_path):
    (tmp_path / "a.skel").write_text(SKEL)
    (tmp_path / "a.anim").write_text(GOOD)
    with pytest.raises(RigError) as caught:
        load(tmp_path / "a.skel", tmp_path / "a.anim")
    assert str(caught.value) == (
        f"{tmp_path / 'a.anim'}: found 1 channel, {tmp_path / 'a.skel'} needs 6 (3 + 3 x 1 joints)"
    )


def test_clip_for_a_body_is_refused_with_the_reason(tmp_path):
    """The wasp's 72 channels and SMPL's 72 values have different meanings."""
    np.savez(tmp_path / "smpl.npz", **model("smpl", 32))
    channel = "channel { extrapolate linear linear keys 1 { 0 0 flat flat } } "
    (tmp_path / "a.anim").write_text(f"animation {{ range 1 2 numchannels 72 {72 * channel} }}")
    with pytest.raises(RigError) as caught:
        load(tmp_path / "smpl.npz", tmp_path / "a.anim")
    assert str(caught.value) == (
        f"{tmp_path / 'a.anim'}: found 72 channels, {tmp_path / 'smpl.npz'} is not a .skel-style "
        "rig, in which clips translate the root along x, y, z and rotate each joint about x, y, z: "
        "joint pelvis has DOFs x, y, z"
    )


def test_clip_without_a_skeleton_is_refused(tmp_path):
    (tmp_path / "a.anim").write_text(GOOD)
    with pytest.raises(RigError, match=r"open it together with its \.skel"):
        load(tmp_path / "a.anim")


def test_clip_poses_its_actor_at_the_start_of_the_range(tmp_path):
    key = "channel {{ extrapolate linear linear keys 2 {{ 0 0 flat {0} 1 {0} {0} flat }} }}"
    channels = " ".join(key.format(value) for value in (1, 2, 3, 0.1, 0.2, 0.3))
    (tmp_path / "a.skel").write_text(SKEL.replace("offset", "rotylimit 0 0.05 offset"))
    (tmp_path / "a.anim").write_text(f"animation {{ range 1 2 numchannels 6 {channels} }}")
    actor = load(tmp_path / "a.skel", tmp_path / "a.anim").actors[0]
    assert actor.clip is not None
    # The rotation about y is clamped to its limit.
    np.testing.assert_allclose(actor.pose.dofs, [1, 2, 3, 0.1, 0.05, 0.3], atol=1e-12)


def test_unsorted_keys_are_sorted_with_a_warning():
    clip, warnings = parse(GOOD.replace("0 1 flat smooth 2", "3 1 flat smooth 2"))
    np.testing.assert_array_equal(clip.channels[0].times, [2, 3])
    assert warnings == [("C001.anim-sorted", 1, {"channel": 0, "late": 1, "before": 0})]


def test_channel_without_keys_is_reported_as_a_warning():
    _, warnings = parse("animation { range 0 1 numchannels 1 channel { keys 0 { } } }")
    assert warnings == [("C010.anim-no-keys", None, {"channel": 0})]


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (
            "balloon {",
            (
                "F002.anim-word",
                1,
                {
                    "where": "animation",
                    "found": b"balloon",
                    "begins": None,
                    "expected": "animation",
                    "looks": None,
                },
            ),
        ),
        (
            GOOD.replace("\n", "").replace("keys", "\nkeys").replace("flat", "steep"),
            (
                "F002.anim-tangent",
                2,
                {
                    "where": "channel 0, key 0",
                    "found": b"steep",
                    "begins": None,
                    "rules": ("flat", "linear", "smooth"),
                },
            ),
        ),
        (
            GOOD.replace("bounce", "jump"),
            (
                "F002.anim-mode",
                1,
                {
                    "where": "channel 0",
                    "found": b"jump",
                    "begins": None,
                    "modes": ("constant", "linear", "cycle", "cycle_offset", "bounce"),
                },
            ),
        ),
        (
            GOOD.replace("{ 0 1", "{ 0 nan"),
            (
                "F003.number",
                1,
                {
                    "where": "channel 0, key 0",
                    "found": b"nan",
                    "begins": None,
                    "item": "channel 0, key 0: value",
                },
            ),
        ),
        (
            GOOD.replace("keys 2", "keys 3"),
            (
                "F002.anim-keys",
                1,
                {"where": "channel 0", "found": 2, "begins": None, "expected": 3},
            ),
        ),
        (
            GOOD.replace("keys 2", "keys 2000000000"),
            (
                "F002.anim-count",
                1,
                {
                    "where": "channel 0",
                    "found": b"2000000000",
                    "begins": None,
                    "item": "channel 0: keys",
                    "left": len(GOOD.split("keys 2")[1]),
                },
            ),
        ),
        (
            GOOD.replace("numchannels 1", "numchannels 2"),
            (
                "F002.anim-channels",
                1,
                {"where": "animation", "found": 1, "begins": None, "expected": 2},
            ),
        ),
        (
            GOOD.split("keys")[0],
            (
                "F002.anim-word",
                1,
                {
                    "where": "channel 0",
                    "found": None,
                    "begins": "channel 0 begins on line 1",
                    "expected": "}",
                    "looks": None,
                },
            ),
        ),
        (
            GOOD.replace("channel {", "\nchannel {").replace(" linear", "").split("-0.5")[0],
            (
                "F002.anim-tangent",
                2,
                {
                    "where": "channel 0, key 1",
                    "found": None,
                    "begins": "channel 0 begins on line 2",
                    "rules": ("flat", "linear", "smooth"),
                },
            ),
        ),
        (
            GOOD.replace("} }", "} keys 0 { } }", 1),
            ("F002.anim-keys-again", 1, {"where": "channel 0", "found": b"keys", "begins": None}),
        ),
        (
            GOOD.replace("numchannels 1 channel", "numchannels 1 chanel"),
            ("F002.anim-item", 1, {"where": "animation", "found": b"chanel", "begins": None}),
        ),
        (
            GOOD.replace("numchannels 1", "numchannels -1"),
            (
                "F002.anim-count",
                1,
                {
                    "where": "animation",
                    "found": b"-1",
                    "begins": None,
                    "item": "animation: numchannels",
                    "left": len(GOOD.split("numchannels 1")[1]),
                },
            ),
        ),
        (
            GOOD.replace("numchannels 1", "numchannels 1.5"),
            (
                "F002.anim-count",
                1,
                {
                    "where": "animation",
                    "found": b"1.5",
                    "begins": None,
                    "item": "animation: numchannels",
                    "left": len(GOOD.split("numchannels 1")[1]),
                },
            ),
        ),
        (
            GOOD.replace("range -1 4", "range -1 up"),
            (
                "F002.number",
                1,
                {"where": "animation", "found": b"up", "begins": None, "item": "animation: range"},
            ),
        ),
        ("", ("F002.kind", None, {"wanted": ".anim", "looks": "an empty file"})),
        (
            GOOD.replace("extrapolate", "extrapolates"),
            (
                "F002.anim-channel-item",
                1,
                {"where": "channel 0", "found": b"extrapolates", "begins": None},
            ),
        ),
        (
            "animation {\nrange 0",
            (
                "F002.anim-end",
                2,
                {
                    "where": "animation",
                    "found": None,
                    "begins": "animation begins on line 1",
                    "item": "animation: range",
                },
            ),
        ),
        (
            GOOD.replace("numchannels 1 ", ""),
            ("F002.anim-no-count", 1, {"where": "animation", "found": 1, "begins": None}),
        ),
    ],
)
def test_malformed_files_are_refused_with_their_line(text, fault):
    assert refusal_of(lambda: parse(text)) == fault


def test_truncation_anywhere_is_an_error_or_a_warning():
    for length in range(len(GOOD)):
        try:
            _, warnings = parse(GOOD[:length])
        except FormatError as problem:
            assert str(problem).startswith("walk.anim")
        else:
            assert warnings, GOOD[:length]
