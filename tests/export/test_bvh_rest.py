"""BVH exports of figures with several roots or a rotated or scaled rest pose, and their angles."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from export.bvh_animations import (
    TO_Y,
    assert_places,
    body_animation,
    chain,
    quaternions,
    rig_animation,
    write,
)
from hypothesis import given
from hypothesis import strategies as st
from plain_bvh import about

import viewer
from viewer.export._options import ROTATION_ORDERS
from viewer.export.bvh.angles import euler_angles, unrolled
from viewer.formats import Source, bvh
from viewer.formats.bvh.text import safe_names
from viewer.loading import bundled_body
from viewer.rig.figure import Figure
from viewer.rig.motion.sampled_animation import sample_animation
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.scene import Actor


def test_rest_rotations_are_removed_from_the_rest_pose(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    skeleton = chain(4)
    skeleton = replace(skeleton, rest_rotations=quaternions(rng.uniform(-2, 2, (4, 3))))
    still = SampledClip("still", Timing(25.0, np.array([0])), skeleton.rest_rotations[None])
    animation = sample_animation(Actor(Figure("rig", skeleton=skeleton), clip=still))
    found, _ = write(animation, tmp_path)
    assert_places(found, animation)
    np.testing.assert_allclose(found.frames[0], np.zeros(15), atol=1e-6)
    moving = rig_animation(skeleton, 6)
    assert_places(write(moving, tmp_path)[0], moving)


def test_scales_at_rest_are_baked(tmp_path: Path) -> None:
    skeleton = replace(chain(4), rest_scales=np.array([[2.0] * 3, [0.5] * 3, [3.0] * 3, [1.0] * 3]))
    animation = rig_animation(skeleton)
    found, notes = write(animation, tmp_path)
    assert_places(found, animation)
    np.testing.assert_allclose(found.offsets[1:], [[0, 2, 1], [0, 1, 0.5], [0, 3, 1.5]])
    assert all(len(channels) == 3 for channels in found.channels[1:]) and len(notes) == 1


def test_non_uniform_scales_are_written_as_position_channels(tmp_path: Path) -> None:
    skeleton = replace(chain(4), rest_scales=np.array([[2.0, 1.0, 0.5], *[[1.0] * 3] * 3]))
    animation = rig_animation(skeleton)
    found, notes = write(animation, tmp_path)
    assert_places(found, animation)
    assert [len(channels) for channels in found.channels] == [6, 3, 6, 6]
    assert notes[1] == ("2 joints below the root translate and have position channels: c, d")


def test_moving_joints_get_position_channels_and_shifted_joints_an_offset(tmp_path: Path) -> None:
    shifts = np.zeros((6, 4, 3))
    shifts[:, 1] = 0.25, 0.5, -1.0
    shifts[3:, 3, 0] = 2.0
    animation = rig_animation(chain(4), translations=shifts)
    found, notes = write(animation, tmp_path)
    assert_places(found, animation)
    assert [len(channels) for channels in found.channels] == [6, 3, 3, 6]
    np.testing.assert_allclose(found.offsets[1], [0.25, 1.5, -0.5])
    assert notes[1] == ("1 joint below the root translates and has position channels: d")


def test_constant_scale_is_exact_and_changing_scale_is_reported(tmp_path: Path) -> None:
    animation = rig_animation(
        chain(), figure_scales=np.full(6, 2.5), figure_translations=np.ones((6, 3))
    )
    found, notes = write(animation, tmp_path)
    assert_places(found, animation)
    np.testing.assert_allclose(found.offsets[1], [0, 2.5, 1.25])
    assert len(notes) == 1
    growing = rig_animation(chain(), figure_scales=np.linspace(1, 2, 6))
    notes = write(growing, tmp_path)[1]
    assert notes[1].startswith("PATH: joints differ from the motion by up to ")
    assert notes[1].endswith(" units (c, frame 5)")
    assert notes[2] == ("the figure's scale changes from 1 to 2: bone lengths are written with 1")


def test_several_roots_get_a_common_parent(tmp_path: Path) -> None:
    skeleton = replace(chain(4), parents=np.array([-1, 0, -1, 2]), names=("root", "b", "c", "d"))
    shifts = np.zeros((6, 4, 3))
    shifts[:, 2, 1] = np.arange(6)
    animation = rig_animation(skeleton, translations=shifts, figure_translations=np.ones((6, 3)))
    found, notes = write(animation, tmp_path, world_up="z")
    assert found.names[0] == "common_root" and found.parents == [-1, 0, 1, 0, 3]
    assert_places(found, animation, turn=TO_Y)
    assert [len(channels) for channels in found.channels] == [6, 3, 3, 6, 3]
    assert notes[1] == "several roots: a common parent joint common_root was added"


ODD = ("left leg", "", "left leg", "é:x", "mixamorig:Hips", "spine.001", "センター", "a  b")


def test_names_are_written_as_they_are(tmp_path: Path) -> None:
    animation = rig_animation(replace(chain(8), names=ODD))
    found, notes = write(animation, tmp_path)
    assert found.names == [*ODD]
    assert (
        b"\tJOINT \xe3\x82\xbb\xe3\x83\xb3\xe3\x82\xbf\xe3\x83\xbc\n"
        in (tmp_path / "out.bvh").read_bytes()
    )
    assert bvh.read(Source.open(tmp_path / "out.bvh")).figure.skeleton.names == ODD
    # Colons and full stops are read by all programs.
    assert notes[1] == (
        "some programs cannot read 5 joint names that are empty or repeated, or have spaces or "
        'characters outside ASCII: left leg, "", é:x, センター, a  b; --safe-names changes them'
    )
    # Repeated names do not confuse the comparison with the motion, which finds no error.
    assert len(notes) == 2


def test_safe_names_are_unique_and_ascii_and_each_change_is_said(tmp_path: Path) -> None:
    animation = rig_animation(replace(chain(8), names=ODD))
    found, notes = write(animation, tmp_path, safe_names=True)
    assert found.names == ["left_leg", "joint1", "left_leg_2", "e_x", "mixamorig_Hips",
                           "spine_001", "joint6", "a__b"]  # fmt: skip
    assert notes[1].startswith("8 joint names changed: left leg to left_leg, ")
    assert "センター to joint6" in notes[1]


def test_names_that_the_format_cannot_hold_are_changed_and_said(tmp_path: Path) -> None:
    names = ("a{b}", "c\nd", " e ", "offset 3", "f\ud800")
    found, notes = write(rig_animation(replace(chain(5), names=names)), tmp_path)
    assert found.names == ["a_b_", "c_d", "e", "offset_3", "f_"]
    assert notes[1].startswith("5 joint names changed: a{b} to a_b_, ")


def test_lengths_of_a_figure_without_a_unit_are_unscaled(tmp_path: Path) -> None:
    animation = rig_animation(chain())
    found, notes = write(animation, tmp_path, unit="cm")
    assert_places(found, animation)
    assert "the figure's unit, y up" in notes[0]
    assert notes[1] == "lengths are unchanged: the unit of rig is unknown"


def test_end_sites_are_half_the_last_bone_or_end_at_the_skin(tmp_path: Path) -> None:
    found, _ = write(rig_animation(chain()), tmp_path)
    np.testing.assert_allclose(found.ends[2], [0, 0.5, 0.25])
    boxes = np.zeros((3, 2, 3))
    boxes[2] = [[-0.1, 0, -0.1], [0.1, 0.75, 0.1]]
    found, _ = write(rig_animation(replace(chain(), boxes=boxes)), tmp_path)
    np.testing.assert_allclose(found.ends[2], [0, 0.75, 0])
    found, _ = write(rig_animation(chain(1)), tmp_path)
    np.testing.assert_allclose(found.ends[0], [0, 0.5, 0])  # no bone determines the direction


def test_end_sites_of_the_bundled_body_are_on_its_skin(tmp_path: Path) -> None:
    figure = viewer.load(bundled_body()).actors[0].figure
    found, _ = write(body_animation(figure, 2), tmp_path, unit="m")
    head = found.ends[found.names.index("head")]
    top = figure.mesh.positions[:, 1].max() - viewer.rig.shape.rest_joints(figure)[15, 1]
    # Shape and slant of the neck move the end site by a few centimetres.
    assert head[1] == pytest.approx(top, abs=0.06)


def angle_product(order: str, angles: np.ndarray) -> np.ndarray:
    result = np.eye(3)
    for axis, angle in zip(order, angles, strict=True):
        result = result @ np.array(about("xyz".index(axis), float(angle)))
    return result


quarter = st.integers(-8, 8).map(lambda n: n * np.pi / 4)
angle = quarter | st.floats(-7, 7)


@pytest.mark.slow
@given(
    st.sampled_from(ROTATION_ORDERS),
    st.lists(st.tuples(angle, angle, angle), min_size=1, max_size=8),
)
def test_angles_reproduce_rotations_even_at_gimbal_lock(order: str, rows: list) -> None:
    turns = np.array([angle_product(order, row) for row in rows])
    for angles in (euler_angles(turns, order), unrolled(euler_angles(turns, order), order)):
        for row, turn in zip(angles, turns, strict=True):
            np.testing.assert_allclose(angle_product(order, row), turn, atol=1e-8)


@pytest.mark.parametrize("order", ROTATION_ORDERS)
@pytest.mark.parametrize("which", [0, 1, 2])
def test_angles_are_unwrapped(order: str, which: int) -> None:
    # One axis rotates by several revolutions, and the middle angle passes 90 degrees.
    wanted = np.tile([0.3, 0.2, -0.4], (400, 1))
    wanted[:, which] += np.linspace(0, 15, 400)
    turns = np.array([angle_product(order, row) for row in wanted])
    found = unrolled(euler_angles(turns, order), order)
    np.testing.assert_allclose(np.diff(found, axis=0), np.diff(wanted, axis=0), atol=1e-9)


def test_gimbal_locked_frame_keeps_the_previous_angles() -> None:
    wanted = np.array([[1.0, 1.2, 0.5], [1.0, np.pi / 2, 0.5], [1.0, 1.3, 0.5]])
    for order in ROTATION_ORDERS:
        turns = np.array([angle_product(order, row) for row in wanted])
        np.testing.assert_allclose(unrolled(euler_angles(turns, order), order), wanted, atol=1e-8)


def test_all_rotation_orders_are_supported() -> None:
    assert sorted(ROTATION_ORDERS) == sorted("".join(p) for p in itertools.permutations("xyz"))


def test_repeated_empty_and_foreign_names_become_safe() -> None:
    names = ["hip", "hip", "hip_2", "", "left knee", "Zähler", "日本", "a:b", "a_b"]
    expected = ("hip", "hip_3", "hip_2", "joint3", "left_knee", "Zahler", "joint6", "a_b_2", "a_b")
    assert safe_names(names) == expected


@given(st.lists(st.text(max_size=6) | st.sampled_from(["a", "a_2", "a_3", "joint1"]), max_size=12))
def test_safe_names_of_arbitrary_names_are_valid_and_unique(names: list[str]) -> None:
    found = safe_names(names)
    assert len(set(found)) == len(names)
    assert all(name and set(name) <= set(PLAIN) for name in found)
    assert safe_names(found) == found
    first = {name: index for index, name in reversed(list(enumerate(names)))}
    for index, (old, new) in enumerate(zip(names, found, strict=True)):
        if old and set(old) <= set(PLAIN) and old.strip("_") and first[old] == index:
            assert new == old


PLAIN = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_"
