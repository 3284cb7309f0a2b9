"""Motion in VMC protocol over real sockets; the changes of axes are worked out by hand."""

import math
import random
import socket
import struct
import time
from dataclasses import replace

import numpy as np
import pytest
from live_screen import PATIENCE, can_undo, screen_at

import viewer
from viewer.errors import ViewerError
from viewer.live.osc import messages_of
from viewer.live.vmc import (
    UNITY,
    Receiver,
    Sender,
    is_humanoid,
    packets_of,
    perform,
    performed,
    t_pose,
)
from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.expressions import ExpressionRules

HALF = math.sqrt(0.5)
STILL = (0.0, 0.0, 0.0, 1.0)
# A T-pose in the axes of VRM 1.0: y up, facing +z, the left side at +x; metres.
CENTRE = {"Hips": (0, 1, 0), "Spine": (0, 1.1, 0), "Neck": (0, 1.5, 0), "Head": (0, 1.6, 0)}
LEFT = {
    **{"UpperLeg": (0.1, 1, 0), "LowerLeg": (0.1, 0.5, 0), "Foot": (0.1, 0.1, 0)},
    **{"UpperArm": (0.2, 1.4, 0), "LowerArm": (0.5, 1.4, 0), "Hand": (0.8, 1.4, 0)},
}
ABOVE = {
    **{"Spine": "Hips", "Neck": "Spine", "Head": "Neck"},
    **{"UpperLeg": "Hips", "LowerLeg": "UpperLeg", "Foot": "LowerLeg"},
    **{"UpperArm": "Spine", "LowerArm": "UpperArm", "Hand": "LowerArm"},
}
# From the axes above to those of figures: as they are; z up and facing -y, in centimetres; facing
# -z, as VRM 0.x.
KINDS = {
    "modern": (np.eye(3), "y", "m"),
    "z up": (100.0 * np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), "z", "cm"),
    "turned": (np.diag([-1.0, 1.0, -1.0]), "y", "m"),
}


def places():
    found = {name: np.array(place, float) for name, place in CENTRE.items()}
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        for name, place in LEFT.items():
            found[side + name] = np.array(place) * [sign, 1.0, 1.0]
    return found


def above(name):
    side = next((side for side in ("Left", "Right") if name.startswith(side)), "")
    parent = ABOVE.get(name.removeprefix(side), "")
    return parent if parent in CENTRE else side + parent if parent else ""


def dummy(kind="modern", size=1.0):
    """Return a humanoid of these joints, and the matrix from VRM's axes and unit to its own."""
    matrix, up, unit = KINDS[kind]
    names = sorted(places(), key=lambda name: (len(path(name)), name))
    joints = np.array([size * matrix @ places()[name] for name in names])
    parents = [names.index(above(name)) if above(name) else -1 for name in names]
    ground = [
        size * matrix @ np.array(corner, float) for corner in ((0, 0, 0), (1, 0, 0), (0, 0, 1))
    ]
    figure = viewer.figure(
        ground, [[0, 1, 2]], joints=joints, parents=parents, names=names, up=up, unit=unit
    )
    return figure, size * matrix


def path(name):
    return [name, *path(above(name))] if name else []


def osc(address, *arguments):
    """Write a message without code of the viewer."""
    tags, data = ",", b""
    for each in arguments:
        if isinstance(each, str):
            tags, data = tags + "s", data + padded(each)
        elif isinstance(each, int):
            tags, data = tags + "i", data + struct.pack(">i", each)
        else:
            tags, data = tags + "f", data + struct.pack(">f", each)
    return padded(address) + padded(tags) + data


def padded(text):
    data = text.encode() + b"\0"
    return data + b"\0" * (-len(data) % 4)


def bundle(*messages):
    return b"#bundle\0" + bytes(8) + b"".join(struct.pack(">i", len(m)) + m for m in messages)


def bone(name, turn=STILL, place=(0.0, 0.0, 0.0)):
    return osc("/VMC/Ext/Bone/Pos", name, *map(float, (*place, *turn)))


def posed(figure, *messages):
    """Return the joints by name in the pose that a receiver makes of messages: (3,) each."""
    receiver = Receiver("127.0.0.1", 0)
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stream:
            stream.sendto(bundle(*messages), ("127.0.0.1", receiver.port))
        deadline = time.monotonic() + PATIENCE
        while not receiver.has_news:
            assert time.monotonic() < deadline
            time.sleep(0.001)
        actor = viewer.Actor(figure)
        actor.pose = perform(t_pose(figure), actor.pose, receiver.take())
        assert receiver.counts.malformed == 0
    finally:
        receiver.close()
    shown = actor.joints()[0]
    return dict(zip(figure.skeleton.names, shown, strict=True))


@pytest.mark.parametrize("kind", KINDS)
def test_quarter_turns_arrive_in_the_axes_of_the_figure(kind):
    figure, matrix = dummy(kind)
    # Unity's axes are x right, y up, z ahead: the left side is at -x. About x, y goes to z, so the
    # shin (0, -1, 0) goes to (0, 0, -1), backwards. About z, x goes to y, so the left arm
    # (-1, 0, 0) goes to (0, -1, 0), down.
    found = posed(
        figure,
        bone("LeftLowerLeg", (HALF, 0.0, 0.0, HALF)),
        bone("LeftUpperArm", (0.0, 0.0, HALF, HALF)),
    )
    size = np.abs(matrix).max()
    for name, place in (
        ("LeftFoot", (0.1, 0.5, -0.4)),
        ("LeftLowerArm", (0.2, 1.1, 0.0)),
        ("LeftHand", (0.2, 0.8, 0.0)),
        ("RightHand", (-0.8, 1.4, 0.0)),
    ):
        assert found[name] == pytest.approx(matrix @ place, abs=1e-6 * size), name


@pytest.mark.parametrize("kind", KINDS)
def test_root_and_hips_move_and_turn_the_figure(kind):
    figure, matrix = dummy(kind)
    # A quarter turn about y in Unity takes z, ahead, to x, right: -x of VRM. Root at x = 1 to the
    # right and 2 ahead is (-1, 0, 2).
    root = osc("/VMC/Ext/Root/Pos", "root", 1.0, 0.0, 2.0, 0.0, HALF, 0.0, HALF)
    found = posed(figure, root, bone("Hips", place=(0.0, 1.2, 0.0)), bone("Spine"))
    size = np.abs(matrix).max()
    assert found["Hips"] == pytest.approx(matrix @ (-1.0, 1.2, 2.0), abs=1e-6 * size)
    # The left hand was at x = 0.8 and 0.4 above the hips; +x goes to +z.
    assert found["LeftHand"] == pytest.approx(matrix @ (-1.0, 1.6, 2.8), abs=1e-6 * size)


def test_path_is_scaled_by_the_length_of_the_legs():
    figure, _ = dummy(size=2.0)
    found = posed(
        figure,
        bone("Hips", place=(0.5, 1.0, 0.0)),
        bone("LeftLowerLeg", place=(0.0, -0.5, 0.0)),
        bone("LeftFoot", place=(0.0, -0.4, 0.0)),
    )
    assert found["Hips"] == pytest.approx((-1.0, 2.0, 0.0), abs=1e-6)


def test_legs_without_length_do_not_scale_the_path():
    figure, _ = dummy()
    legs = (bone(f"Left{name}", place=(0.0, 1e-20, 0.0)) for name in ("LowerLeg", "Foot"))
    found = posed(figure, bone("Hips", place=(0.5, 1.0, 0.0)), *legs)
    assert found["Hips"] == pytest.approx((-0.5, 1.0, 0.0), abs=1e-6)


def test_rotations_add_up_along_bones_that_the_figure_lacks():
    figure, _ = dummy()
    found = posed(
        figure, bone("Hips", place=(0, 1, 0)), bone("Spine"), bone("Chest", (0, HALF, 0, HALF)),
        bone("LeftUpperArm"),
    )  # fmt: skip
    # The figure has no chest: its arm is turned by it all the same, from +x to +z.
    step = found["LeftHand"] - found["LeftUpperArm"]
    assert step == pytest.approx((0.0, 0.0, 0.6), abs=1e-6)


def test_unmentioned_joints_stay_as_they_are():
    figure, _ = dummy()
    actor = viewer.Actor(figure)
    actor["RightLowerLeg"] = [math.pi / 2, 0.0, 0.0]
    receiver = Receiver("127.0.0.1", 0)
    receiver.receive(bone("LeftLowerArm", (0.0, HALF, 0.0, HALF)))
    actor.pose = perform(t_pose(figure), actor.pose, receiver.take())
    receiver.close()
    shown = dict(zip(figure.skeleton.names, actor.joints()[0], strict=True))
    assert shown["RightFoot"] == pytest.approx((-0.1, 0.5, -0.4), abs=1e-9)


def test_names_of_unity_are_those_of_vrm_0():
    assert UNITY["LeftThumbProximal"] == "leftThumbMetacarpal"
    assert UNITY["RightThumbIntermediate"] == "rightThumbProximal"
    assert UNITY["LeftThumbDistal"] == "leftThumbDistal"
    assert UNITY["UpperChest"] == "upperChest"
    assert len(UNITY) == 55  # Unity's HumanBodyBones


@pytest.mark.parametrize("name", ["Joy", "happy", "HAPPY"])
def test_expressions_of_both_versions_of_vrm_are_applied_together(name):
    rules = ExpressionRules([1], [False], [-1], [[0, 0, 0]], ("happy",))
    shapes = BlendShapes(("nose", "Smile"), np.ones((2, 3, 3)), ("morph",) * 2, rules=rules)
    figure = replace(dummy()[0], blend_shapes=shapes)
    receiver = Receiver("127.0.0.1", 0)
    receiver.receive(osc("/VMC/Ext/Blend/Val", name, 0.75))
    assert not receiver.take().expressions  # not applied yet
    receiver.receive(osc("/VMC/Ext/Blend/Apply"))
    pose = perform(t_pose(figure), viewer.Actor(figure).pose, receiver.take())
    receiver.close()
    assert pose.shape_weights.tolist() == [0.0, 0.75]
    sent = [each for data in packets_of(performed(t_pose(figure), pose), 0.0)
            for each in messages_of(data)]  # fmt: skip
    assert sent[-2:] == [("/VMC/Ext/Blend/Val", ("Joy", 0.75)), ("/VMC/Ext/Blend/Apply", ())]


@pytest.mark.parametrize("kind", KINDS)
def test_sent_bones_have_the_axes_of_unity(kind):
    figure, _ = dummy(kind)
    actor = viewer.Actor(figure)
    how = t_pose(figure)
    # In VRM's axes, the knee bends by 90 degrees about +x, which is +x in Unity, too. The figure's
    # own axes are turned: x is x, but -x where it faces -z.
    actor["LeftLowerLeg"] = np.array([math.pi / 2, 0.0, 0.0]) * (-1.0 if kind == "turned" else 1.0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stream:
        stream.bind(("127.0.0.1", 0))
        stream.settimeout(PATIENCE)
        sender = Sender("127.0.0.1", stream.getsockname()[1])
        try:
            sender.send(performed(how, actor.pose))
            found = {}
            while "/VMC/Ext/Bone/Pos RightHand" not in found:
                for address, arguments in messages_of(stream.recv(2000)):
                    is_named = bool(arguments) and isinstance(arguments[0], str)
                    key = f"{address} {arguments[0]}" if is_named else address
                    found[key] = arguments[1:] if is_named else arguments
        finally:
            sender.close()
    assert found["/VMC/Ext/OK"] == (1,)
    assert len(found["/VMC/Ext/T"]) == 1
    assert found["/VMC/Ext/Root/Pos root"] == (0.0, 0.0, 0.0, *STILL)
    turned = np.array(found["/VMC/Ext/Bone/Pos LeftLowerLeg"][3:])
    assert turned * np.sign(turned[3]) == pytest.approx((HALF, 0.0, 0.0, HALF), abs=1e-6)
    assert found["/VMC/Ext/Bone/Pos Hips"][:3] == pytest.approx((0.0, 1.0, 0.0), abs=1e-6)
    # From the left thigh at (0.1, 1, 0) to the knee; from the hips to the thigh, at -x in Unity.
    assert found["/VMC/Ext/Bone/Pos LeftLowerLeg"][:3] == pytest.approx((0.0, -0.5, 0.0), abs=1e-6)
    assert found["/VMC/Ext/Bone/Pos LeftUpperLeg"][:3] == pytest.approx((-0.1, 0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"junk",
        osc("/VMC/Ext/Bone/Pos", "LeftFoot", 0.0, 0.0),
        osc("/VMC/Ext/Bone/Pos", 3, *map(float, range(7))),
        bone("Tail"),
        bone("LeftFoot", (0.0, 0.0, 0.0, 0.0)),
        bone("LeftFoot", (0.0, 0.0, 0.0, math.nan)),
        bone("LeftFoot", place=(math.inf, 0.0, 0.0)),
        bone("Hips", place=(1e30, 0.0, 0.0)),
        osc("/VMC/Ext/Root/Pos", "root", 0.0, -1e30, 0.0, *STILL),
        osc("/VMC/Ext/Blend/Val", "Joy", 1e30),
        osc("/VMC/Ext/Blend/Val", "Joy"),
        osc("/VMC/Ext/T", "now"),
        bundle(bone("LeftFoot"), bone("LeftFoot", (2.0, 0.0, 0.0, 0.0))),
    ],
)
def test_malformed_packet_is_ignored_as_a_whole_and_counted(data):
    receiver = Receiver("127.0.0.1", 0)
    receiver.receive(data)
    assert (receiver.counts.packets, receiver.counts.malformed) == (1, 1)
    assert not receiver.has_news or not receiver.take().bones
    receiver.receive(osc("/VMC/Ext/Hmd/Pos", "a", *map(float, range(7))))  # of no interest here
    assert receiver.counts.malformed == 1
    receiver.close()


def test_random_packets_are_counted_and_need_bounded_memory():
    rng, receiver = random.Random(3), Receiver("127.0.0.1", 0)
    whole = bundle(bone("LeftFoot"), osc("/VMC/Ext/Blend/Val", "Joy", 0.5), osc("/VMC/Ext/T", 1.0))
    for _ in range(1500):
        data = bytearray(whole)
        for _ in range(rng.randrange(1, 4)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        receiver.receive(bytes(data))
    for number in range(2000):
        receiver.receive(osc("/VMC/Ext/Blend/Val", f"shape {number}", 0.5))
    receiver.close()
    assert receiver.counts.packets == 3500
    assert receiver.counts.malformed > 1500
    assert len(receiver._pending) <= 500


def test_expressions_of_several_performers_are_kept_in_bounded_memory():
    rules = ExpressionRules([1, 2], [False] * 2, [-1] * 2, [[0, 0, 0]] * 2, ("happy", "aa"))
    shapes = BlendShapes(("nose", "Smile", "A"), np.ones((3, 3, 3)), ("morph",) * 3, rules=rules)
    figure = replace(dummy()[0], blend_shapes=shapes)
    receiver, actor = Receiver("127.0.0.1", 0), viewer.Actor(figure)
    actor.pose.shape_weights[0] = 0.25  # by the user
    how = t_pose(figure)
    for name, weight in (("Joy", 0.75), ("aa", 0.5), ("happy", 1.0)):
        receiver.receive(osc("/VMC/Ext/Blend/Val", name, weight))
        receiver.receive(osc("/VMC/Ext/Blend/Apply"))
        actor.pose = perform(how, actor.pose, receiver.take())
    assert actor.pose.shape_weights.tolist() == [0.25, 1.0, 0.5]
    for number in range(1200):
        receiver.receive(osc("/VMC/Ext/Blend/Val", f"shape {number}", 0.5))
        receiver.receive(osc("/VMC/Ext/Blend/Apply"))
    given = receiver.take().expressions
    receiver.close()
    assert len(given) == 500
    assert "shape 1199" in given


def test_window_is_moved_by_a_performer_and_shows_the_counts(tmp_path):
    figure, matrix = dummy("z up")
    scene = viewer.Scene([viewer.load()[0], viewer.Actor(figure)])  # the fox is no humanoid
    with screen_at(tmp_path / "window.json", scene, vmc=True) as screen:
        receiver = screen.live.vmc_in
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stream:
            for data in (b"junk", bone("LeftUpperArm", (0.0, 0.0, HALF, HALF))):
                stream.sendto(data, ("127.0.0.1", receiver.port))
        hand = figure.skeleton.names.index("LeftHand")
        wanted = matrix @ (0.2, 0.8, 0.0)
        screen.wait(lambda: np.allclose(scene[1].joints()[0, hand], wanted, atol=1e-4))
        screen.wait(lambda: ("VMC in", "2 packets, 1 malformed") in screen.state.stats.live)
        assert not can_undo(screen)


def test_scene_without_a_humanoid_is_said_once(tmp_path):
    with screen_at(tmp_path / "window.json", vmc=True) as screen:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stream:
            for _ in range(3):
                stream.sendto(bone("LeftFoot"), ("127.0.0.1", screen.live.vmc_in.port))
        screen.wait(lambda: screen.live.vmc_in.counts.packets == 3)
        log = screen.state.messages.log
        screen.wait(lambda: any("humanoid" in each.text for each in log))
        assert [each.count for each in log if "humanoid" in each.text] == [1]


def test_bundled_body_is_a_humanoid_and_the_fox_is_not():
    assert is_humanoid(viewer.load("body")[0].figure)
    assert not is_humanoid(viewer.load("fox")[0].figure)


def test_port_in_use_is_an_error_of_one_line():
    receiver = Receiver("127.0.0.1", 0)
    with pytest.raises(ViewerError, match=f"--vmc-in 127.0.0.1:{receiver.port}"):
        Receiver("127.0.0.1", receiver.port)
    receiver.close()


@pytest.mark.parametrize("host", ["é..x", f"{'é' * 70}.example"])
def test_impossible_host_is_an_error_of_one_line(host):
    with pytest.raises(ViewerError, match=f"--vmc-in {host[:10]}"):
        Receiver(host, 39539)
    with pytest.raises(ViewerError, match=f"--vmc-out {host[:10]}"):
        Sender(host, 39539)
