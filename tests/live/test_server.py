"""Programs that move a window over real loopback connections; expected numbers are by hand."""

import hmac
import io
import json
import math
import os
import random
import re
import socket
import stat
import sys
import threading
import time
import warnings
from contextlib import contextmanager, suppress
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import platformdirs
import pytest
from live.test_live_messages import framed
from live_screen import can_undo, screen_at

import viewer
from viewer.app.closing import Closing
from viewer.app.live import _ACTIONS
from viewer.errors import ViewerError
from viewer.live.connection_file import file_path
from viewer.live.handshake import join
from viewer.live.messages import Message, packed, read, receiver
from viewer.live.objects import pack
from viewer.live.server import Server
from viewer.rigs.blendshapes import BlendShapes

QUARTER = math.pi / 2


def bar(name="bar"):
    """Return two joints along x; the vertices at x = 2 follow the second one, at x = 1."""
    corners = [[0, 0, 0], [2, 0, 0], [2, 0, 1]]
    weights = [[1, 0], [0, 1], [0, 1]]
    return viewer.figure(
        corners, [[0, 1, 2]], weights=weights, joints=[[0, 0, 0], [1, 0, 0]], name=name
    )


@pytest.fixture
def screen(tmp_path):
    with screen_at(tmp_path / "window.json", viewer.Scene([viewer.Actor(bar("first"))])) as screen:
        yield screen


@pytest.fixture
def live(screen):
    with viewer.connect(screen.path) as live:
        yield live


def tip(screen, index=-1):
    """Return where the second vertex of an actor is in the window."""
    actor = screen.state.scene.actors[index]
    return viewer.deform(actor.figure, actor.pose)[0][1]


def is_at(screen, place, index=-1):
    return lambda: np.allclose(tip(screen, index), place, atol=1e-12)


def raw(screen, *messages):
    """Send bytes as another program would; return the answers until the server hangs up."""
    found = []
    with socket.create_connection(("127.0.0.1", screen.server.port), 10) as stream:
        receive = receiver(stream)
        for data in messages:
            try:
                stream.sendall(data(found[-1]) if callable(data) else data)
                found.append(read(receive))
            except (EOFError, OSError):
                break
    return found


NONCE = bytes(range(32))


def hello(**changes):
    return packed(Message("hello", {"version": 2, "nonce": NONCE.hex(), **changes}))


def prove(path, side="program", **facts):
    """Return a function that answers the window's nonce, written without code of the viewer."""
    token = json.loads(path.read_text())["token"].encode()

    def answer(found):
        text = side.encode() + NONCE + bytes.fromhex(found.facts["nonce"])
        proof = hmac.new(token, text, "sha256").hexdigest()
        return packed(Message("prove", {"proof": proof, **facts}))

    return answer


def test_added_figure_is_bent_about_its_joint(screen, live):
    actor = live.add(bar())
    actor["joint_1"] = [0.0, 0.0, QUARTER]
    # One unit beyond the joint at x = 1, rotated by 90 degrees about z.
    screen.wait(is_at(screen, [1.0, 1.0, 0.0]))


def test_numbers_changed_in_place_are_noticed(screen, live):
    actor = live.add(bar())
    rows = np.flatnonzero(actor.figure.skeleton.dof_joints == 1)
    actor.pose.dofs[rows[1]] = QUARTER  # about y: x goes to -z
    screen.wait(is_at(screen, [1.0, 0.0, -1.0]))


def test_actor_of_the_window_is_fetched_and_moved(screen, live):
    live["first"].pose.figure_translation[:] = [0.0, 3.0, 0.0]
    live.update()
    screen.wait(is_at(screen, [2.0, 3.0, 0.0]))
    assert len(screen.state.scene.actors) == 1


def test_unknown_name_lists_what_there_is(screen, live):
    shown = re.escape(screen.state.actor.name)
    with pytest.raises(ViewerError, match=f'no actor "second"; there is 1: {shown}$'):
        live["second"]


def test_placement_and_visibility_follow(screen, live):
    actor = live.add(bar())
    actor.placement = np.diag([2.0, 2.0, 2.0, 1.0])
    actor.visible, actor.color = False, (1.0, 0.5, 0.0)
    live.update()
    shown = screen.state.scene.actors[-1]
    assert (shown.visible, shown.color) == (False, (1.0, 0.5, 0.0))
    assert np.array_equal(shown.placement, np.diag([2.0, 2.0, 2.0, 1.0]))


def test_time_poses_actors_by_their_motion(screen, live):
    vectors = np.zeros((3, 2, 3))
    vectors[2, 1] = [0.0, 0.0, QUARTER]
    live.add(viewer.animate(bar(), vectors, fps=10.0))
    live.time = 0.2
    screen.wait(is_at(screen, [1.0, 1.0, 0.0]))
    assert live.time == pytest.approx(0.2)
    live.scene.time = 0.0
    screen.wait(is_at(screen, [2.0, 0.0, 0.0]))


def test_camera_and_selection_are_read_and_set(screen, live):
    live.camera = {"azimuth": 40.0, "target": [0.0, 1.0, 0.0]}
    camera = live.camera
    assert (camera["azimuth"], camera["target"]) == (40.0, [0.0, 1.0, 0.0])
    with pytest.raises(ViewerError, match="camera"):
        live.camera = {"zoom": 1.0}
    assert live.selection == ("first",)
    screen.state.selected_joint = 1
    assert live.selection == ("first", "joint_1")


def test_removed_actor_disappears_but_the_last_one_stays(screen, live):
    actor = live.add(bar())
    live.remove(actor)
    assert [each.name for each in screen.state.scene.actors] == ["first"]
    first = live["first"]
    with pytest.raises(ViewerError, match="at least one"):
        live.remove(first)


def test_figure_is_exchanged(screen, live):
    actor = live.add(bar())
    actor.figure, actor.own_pose = viewer.load().actors[0].figure, None
    actor.__post_init__()
    live.update()
    assert screen.state.scene.actors[-1].figure.mesh.n_vertices == 7561
    assert len(screen.state.scene.actors) == 2


class Upwards:
    """Shapes that a model computes: the weight is a displacement along y."""

    def displacement(self, weights):
        return np.tile([0.0, weights[:1].sum(), 0.0], (3, 1))

    def joint_displacement(self, weights):
        return np.tile([0.0, weights[:1].sum(), 0.0], (2, 1))


def test_shapes_that_a_model_computes_are_sent_as_their_result(screen, live):
    shapes = BlendShapes(("height",), np.ones((1, 3, 3)), space=Upwards())
    actor = live.add(replace(bar(), blend_shapes=shapes))
    for height in (2.0, 3.0):
        actor.pose.shape_weights = np.array([height])
        actor["joint_1"] = [0.0, 0.0, QUARTER]
        live.update()
        screen.wait(is_at(screen, [1.0, height + 1.0, 0.0]))
    assert screen.state.scene.actors[-1].figure.blend_shapes is None


def test_change_while_an_actor_is_sent_is_sent_as_well(screen, live, monkeypatch):
    actor, ask = viewer.Actor(bar()), live._ask

    def bend(do, *rest):
        answer = ask(do, *rest)
        if do == "put":
            actor["joint_1"] = [0.0, 0.0, QUARTER]
        return answer

    monkeypatch.setattr(live, "_ask", bend)
    live.add(actor)
    screen.wait(is_at(screen, [1.0, 1.0, 0.0]))


def test_scene_is_replaced_and_followed(screen, live):
    scene = viewer.Scene([viewer.Actor(bar("a")), viewer.Actor(bar("b"))])
    live.show(scene)
    assert [each.name for each in screen.state.scene.actors] == ["a", "b"]
    scene["a"]["joint_1"] = [0.0, 0.0, QUARTER]
    screen.wait(is_at(screen, [1.0, 1.0, 0.0], 0))
    del scene.actors[0]
    live.update()
    assert [each.name for each in screen.state.scene.actors] == ["b"]


def test_what_programs_send_is_no_edit(screen, live):
    live.add(bar())["joint_1"] = [0.0, 0.0, QUARTER]
    screen.wait(is_at(screen, [1.0, 1.0, 0.0]))
    assert not can_undo(screen)


def edit(screen, angle, index=0):
    """Bend the second joint about z as a slider does."""
    actor = screen.state.scene.actors[index]
    with screen.frame:
        screen.state.observe()
        actor["joint_1"] = [0.0, 0.0, angle]


def is_read(live, name, angle):
    return lambda: live[name]["joint_1"][2] == pytest.approx(angle)


def test_pose_that_the_user_sets_is_read_in_place_and_not_sent_back(screen, live, monkeypatch):
    first, sent = live["first"], []
    pose = first.pose
    ask = live._ask
    monkeypatch.setattr(live, "_ask", lambda do, *rest: sent.append(do) or ask(do, *rest))
    for angle in (QUARTER, 0.0, 0.5):  # dragged, reset, dragged again
        edit(screen, angle)
        screen.wait(is_read(live, "first", angle))
    live.update()
    assert live["first"].pose is pose
    assert "pose" not in sent
    assert "edits" in sent
    assert is_at(screen, [1.0 + math.cos(0.5), math.sin(0.5), 0.0])()
    assert can_undo(screen)  # the edits are still those of the user
    screen.wait(is_read(live, "first", 0.0))  # undone


def test_added_actor_reads_the_user_and_other_numbers_may_be_set(screen, live):
    actor = live.add(bar())
    edit(screen, QUARTER, 1)
    screen.wait(is_read(live, "bar", QUARTER))
    actor.pose.figure_translation[1] = 5.0
    screen.wait(is_at(screen, [1.0, 6.0, 0.0]))


def test_pose_of_the_program_wins(screen, live):
    first = live["first"]
    with screen.frame, live._lock:
        first["joint_1"] = [0.0, 0.0, QUARTER]
        screen.state.observe()
        screen.state.scene.actors[0]["joint_1"] = [0.0, 0.0, 0.5]
    live.update()
    screen.wait(is_at(screen, [1.0, 1.0, 0.0]))
    live.update()
    assert first["joint_1"][2] == pytest.approx(QUARTER)


def test_edit_is_not_told_while_a_pose_of_the_program_waits(screen, live):
    first = live["first"]
    with screen.frame:
        first["joint_1"] = [0.0, 0.0, QUARTER]
        live.update()  # waits for the frame
        screen.server.note({1: screen.state.scene.actors[0].pose.copy()})
        assert not live._ask("edits", {"since": 0}).facts["edits"]
    screen.wait(is_at(screen, [1.0, 1.0, 0.0]))
    live.update()
    assert first["joint_1"][2] == pytest.approx(QUARTER)


def test_both_programs_read_the_user_and_one_that_comes_later_what_is_shown(screen, live):
    live["first"]
    with viewer.connect(screen.path) as other:
        other["first"]
        edit(screen, QUARTER)
        for each in (live, other):
            screen.wait(is_read(each, "first", QUARTER))
        live["first"]["joint_1"] = [0.0, 0.0, 0.5]
        live.update()
        screen.wait(is_at(screen, [1.0 + math.cos(0.5), math.sin(0.5), 0.0]))
    with viewer.connect(screen.path) as late:
        assert late["first"]["joint_1"][2] == pytest.approx(0.5)
        late.update()
        assert late["first"]["joint_1"][2] == pytest.approx(0.5)


def test_motion_of_the_window_is_not_read_but_edits_at_its_time_are(screen, live):
    vectors = np.zeros((3, 2, 3))
    vectors[2, 1] = [0.0, 0.0, QUARTER]
    actor = live.add(viewer.animate(bar(), vectors, fps=10.0))
    own = actor.pose.copy()
    with screen.frame:
        screen.state.clock.seek(0.2)  # as the timeline does
    screen.wait(is_at(screen, [1.0, 1.0, 0.0]))
    live.update()
    assert np.array_equal(actor.pose.values, own.values)
    edit(screen, 0.5, 1)
    screen.wait(is_read(live, "motion", 0.5))
    live.time = 0.0
    assert live["motion"]["joint_1"][2] == pytest.approx(0.5)


def test_weights_that_the_window_has_not_are_kept(screen, live):
    shapes = BlendShapes(("height",), np.ones((1, 3, 3)), space=Upwards())
    actor = live.add(replace(bar(), blend_shapes=shapes))
    actor.pose.shape_weights = np.array([2.0])
    live.update()
    edit(screen, QUARTER, 1)
    screen.wait(is_read(live, "bar", QUARTER))
    assert actor.pose.shape_weights.tolist() == [2.0]


def test_weights_and_scale_that_the_user_sets_are_read(screen, live):
    shapes = BlendShapes(("height",), np.ones((1, 3, 3)))
    actor = live.add(replace(bar(), blend_shapes=shapes))
    with screen.frame:
        screen.state.observe()
        screen.state.scene.actors[1].pose.shape_weights = np.array([0.25])
        screen.state.scene.actors[1].pose.figure_scale = 2.0
    screen.wait(lambda: live["bar"].pose.figure_scale == 2.0)
    assert actor.pose.shape_weights.tolist() == [0.25]


def test_programs_share_a_window_and_leave_what_they_sent(screen):
    with viewer.connect(screen.path) as one, viewer.connect(screen.path) as two:
        one.add(bar("one"))
        actor = two["one"]
        actor["joint_1"] = [0.0, 0.0, QUARTER]
        screen.wait(is_at(screen, [1.0, 1.0, 0.0]))
        assert one.counts["clients"] == 2
    two._socket.close()  # as when a program dies
    screen.wait(lambda: screen.server.counts.clients == 0)
    assert [each.name for each in screen.state.scene.actors] == ["first", "one"]


def test_window_closes_when_the_program_that_owns_it_is_killed(screen):
    raw(screen, hello(), prove(screen.path))
    screen.wait(lambda: screen.server.counts.clients == 0)
    assert not screen.state.of(Closing).is_over
    raw(screen, hello(), prove(screen.path, owns=True))
    screen.wait(lambda: screen.state.of(Closing).is_over)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.filterwarnings("ignore:.*use of fork:DeprecationWarning")
def test_fork_of_a_program_is_not_connected(screen, live):
    first = live["first"]
    for _ in range(5):
        first.pose.figure_translation[1] += 1.0
        child = os.fork()
        if child == 0:
            code = 1
            try:
                first.pose.figure_translation[1] = 99.0
                live.update()
            except ViewerError:
                code = 0
            finally:
                os._exit(code)
        assert os.waitpid(child, 0)[1] == 0
        live.update()
    screen.wait(is_at(screen, [2.0, 5.0, 0.0]))


def test_closed_window_is_an_error_of_one_line(tmp_path):
    with screen_at(tmp_path / "window.json") as screen:
        live = viewer.connect(screen.path)
    with pytest.raises(ViewerError, match="closed"):
        live.update()
    assert not live.is_open


def test_only_the_user_on_this_machine_gets_in(screen):
    assert screen.server._socket.getsockname()[0] == "127.0.0.1"
    assert stat.S_IMODE(screen.path.stat().st_mode) == 0o600
    refused = [
        [hello(), packed(Message("prove", {"proof": "guess"})), packed(Message("get", {}))],
        [hello(), packed(Message("prove", {"proof": "\ud800"}))],
        [hello(), prove(screen.path, side="window")],  # as the window itself answers
        [hello(), packed(Message("get", {}))],
        [hello(version=1)],
        [hello(nonce="00")],
        [packed(Message("get", {}))],
        [packed(Message("prove", {"proof": "guess"}))],
        [framed({"do": "hello", "nonce": "x" * 5000})],
    ]
    answers = [raw(screen, *messages) for messages in refused]
    dos = [[each.do for each in found] for found in answers]
    assert dos == [["ok", "error"]] * 4 + [["error"]] * 5
    assert screen.server.counts.refused == 9
    assert "same version of viewer" in answers[4][0].facts["text"]


def test_token_is_never_sent(screen):
    token = json.loads(screen.path.read_text())["token"]
    greeted, let_in = raw(screen, hello(), prove(screen.path))
    assert let_in.do == "ok"
    text = b"window" + NONCE + bytes.fromhex(greeted.facts["nonce"])
    assert greeted.facts["proof"] == hmac.new(token.encode(), text, "sha256").hexdigest()
    assert token not in str([greeted.facts, let_in.facts])
    again, _ = raw(screen, hello(), prove(screen.path))
    assert again.facts["nonce"] != greeted.facts["nonce"]


@contextmanager
def other_program(path, *answers):
    """Listen on the port of a crashed window, and answer with bytes; yields what is received."""
    received = bytearray()
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port = listening.getsockname()[1]
        path.write_text(json.dumps({"port": port, "token": "secret", "pid": 1}))
        path.chmod(0o600)

        def run():
            with suppress(OSError), listening.accept()[0] as stream:
                for answer in answers:
                    received.extend(stream.recv(10_000))
                    stream.sendall(answer)
                while data := stream.recv(10_000):
                    received.extend(data)

        thread = threading.Thread(target=run)
        thread.start()
        yield received
        with suppress(OSError):
            listening.shutdown(socket.SHUT_RDWR)
        thread.join()


def ok(**facts):
    return packed(Message("ok", facts))


NO_WINDOWS = [
    b"HTTP/1.1 400 Bad Request\r\n\r\n",
    ok(),
    ok(nonce="00", proof="00"),
    ok(nonce=NONCE.hex(), proof=64 * "0"),
    ok(nonce=NONCE.hex(), proof="\ud800"),
    ok(nonce=[], proof=3),
    packed(Message("error", {})),
]


@pytest.mark.parametrize("answer", NO_WINDOWS)
def test_program_on_the_port_of_a_crashed_window_learns_nothing(tmp_path, answer):
    path = tmp_path / "window.json"
    with (
        other_program(path, answer) as received,
        pytest.raises(ViewerError, match="found another program: the window has crashed"),
    ):
        viewer.connect(path)
    told = read(io.BytesIO(received).read)
    assert (told.do, told.facts.keys()) == ("hello", {"version", "nonce"})
    assert received == packed(told)  # nothing follows


def test_proof_of_the_program_is_not_one_of_the_window(tmp_path, monkeypatch):
    monkeypatch.setattr("secrets.token_bytes", lambda size: NONCE)
    path = tmp_path / "window.json"
    proof = hmac.new(b"secret", b"program" + 2 * NONCE, "sha256").hexdigest()
    with (
        other_program(path, ok(nonce=NONCE.hex(), proof=proof)),
        pytest.raises(ViewerError, match="found another program"),
    ):
        viewer.connect(path)


@pytest.mark.parametrize("answer", NO_WINDOWS)
def test_window_opens_where_another_program_has_the_old_port(tmp_path, answer):
    path = tmp_path / "window.json"
    with other_program(path, answer):
        Server(path).close()


def test_window_of_an_older_version_says_so_and_keeps_its_file(tmp_path):
    text = "expected version 1 of the protocol, found 2"  # as version 0.6.0 answers
    path = tmp_path / "window.json"
    with (
        other_program(path, packed(Message("error", {"text": text + "\x1b[2J"}))),
        pytest.raises(ViewerError, match=text) as problem,
    ):
        viewer.connect(path)
    assert "\x1b" not in str(problem.value)
    with (
        other_program(path, packed(Message("error", {"text": text}))),
        pytest.raises(ViewerError, match="expected no other window"),
    ):
        Server(path)


def test_window_that_does_not_answer_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(join, "__defaults__", (False, 0.05))
    path = tmp_path / "window.json"
    with other_program(path), pytest.raises(ViewerError, match="did not answer"):
        viewer.connect(path)


def test_client_without_the_token_may_not_stay_however_slowly_it_sends(screen, monkeypatch):
    monkeypatch.setattr("viewer.live.server._FIRST_SECONDS", 0.2)
    began = time.monotonic()
    with (
        socket.create_connection(("127.0.0.1", screen.server.port), 10) as stream,
        pytest.raises(OSError),
    ):
        for each in hello():
            stream.sendall(bytes([each]))
            time.sleep(0.05)
    assert time.monotonic() - began < 5.0


def test_file_that_others_can_read_is_refused(screen):
    screen.path.chmod(0o644)
    with pytest.raises(ViewerError, match="only you can read"):
        viewer.connect(screen.path)


def test_file_belongs_to_one_window(screen, tmp_path):
    with pytest.raises(ViewerError, match="expected no other window"):
        Server(screen.path)
    gone = tmp_path / "gone.json"
    gone.write_text('{"port": 9, "token": "a", "pid": 1}')
    gone.chmod(0o600)
    with pytest.raises(ViewerError, match="start viewer serve"):
        viewer.connect(gone)
    with screen_at(gone):  # the window that wrote it has crashed
        assert json.loads(gone.read_text())["port"] != 9
    assert not gone.exists()


def test_missing_file_says_what_to_start(tmp_path):
    with pytest.raises(ViewerError, match="start viewer serve"):
        viewer.connect(tmp_path / "none.json")


def pose_of(**changes):
    """Return a message with a pose of the first figure, six DOFs and two joints."""
    count = {"dofs": 6, "translations": (2, 3), "rotations": (2, 4), "scales": (2, 3)}
    arrays = [np.ones(shape) for shape in {**count, "shape": 0, "place": 3, **changes}.values()]
    return Message("pose", {"actor": 1, "figure_scale": 1.0}, arrays)


@pytest.mark.parametrize(
    ("message", "why"),
    [
        (Message("nonsense", {}), "unknown message nonsense"),
        (Message("remove", {}), "actor: expected an integer"),
        (Message("remove", {"actor": 9}), "no actor 9"),
        (Message("time", {"time": "now"}), "expected a number"),
        (Message("time", {"time": 10**400}), "expected a finite number"),
        (
            Message(
                "look",
                {"actor": 1, "opacity": 1, "visible": True, "color": [10**400, 0, 0]},
                [np.eye(4)],
            ),
            "color: expected a finite number",
        ),
        (Message("scene", {"up": "x"}), "up axis"),
        (Message("put", {}), "expected an actor"),
        (Message("put", {"object": {"kind": "Pose", "fields": {}}}), "Pose"),
        (Message("camera", {"distance": -1.0}), "expected 1e-09 to"),
        (pose_of(rotations=(3, 4)), r"expected shape \(2, 4\)"),
        (pose_of(shape=2), "at most 0 shape weights"),
        (Message("pose", {"actor": 1, "figure_scale": 1.0}), "expected array 0, found 0"),
    ],
)
def test_bad_message_is_answered_counted_and_survived(screen, message, why):
    screen.wait(lambda: screen.server.actors)
    _, ok, bad, after = raw(
        screen, hello(), prove(screen.path), packed(message), packed(Message("get", {}))
    )
    assert (ok.do, bad.do, after.do) == ("ok", "error", "ok")
    assert re.search(why, bad.facts["text"]), bad.facts["text"]
    assert after.facts["counts"]["refused"] == 1


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("visible", "yes"),
        ("is_present", None),
        ("person", "one"),
        ("called", 5),
        ("hidden_parts", frozenset(["tail"])),
        ("shape_space", None),
        ("offset", math.nan),
        ("opacity", None),
        ("color", "red"),
        ("color", (1.0, 0.0)),
        ("points", np.zeros(3)),
        ("placement", np.eye(3)),
    ],
)
def test_actor_that_cannot_be_drawn_is_refused(screen, live, name, value):
    actor, arrays = viewer.Actor(bar()), []
    object.__setattr__(actor, name, value)  # as another program may send it
    told = {"object": pack(actor, arrays)}
    with pytest.raises(ViewerError, match=name):
        live._ask("put", told, arrays)
    assert live.selection == ("first",)


def test_figure_without_vertices_is_refused(live):
    with pytest.raises(ViewerError, match="at least one vertex"):
        live.add(viewer.figure(np.zeros((0, 3)), np.zeros((0, 3), int)))
    assert live.selection == ("first",)


def test_look_may_be_numbers_of_numpy(screen, live):
    color = np.array([1.0, 0.5, 0.0], np.float32)
    actor = live.add(viewer.Actor(bar(), color=color, visible=np.bool_(False)))
    shown = screen.state.scene.actors[-1]
    assert (shown.visible, shown.color) == (False, (1.0, 0.5, 0.0))
    actor.color, actor.visible, actor.opacity = color / 2, np.bool_(True), np.float32(0.5)
    live.update()
    assert (shown.visible, shown.color, shown.opacity) == (True, (0.5, 0.25, 0.0), 0.5)


def test_failure_of_an_action_is_answered_and_the_window_goes_on(screen, live, monkeypatch):
    def fail(*_):
        raise ZeroDivisionError("of nothing")

    monkeypatch.setitem(_ACTIONS, "time", fail)
    with pytest.raises(ViewerError, match="ZeroDivisionError: of nothing"):
        live.time = 1.0
    assert live.selection == ("first",)


def test_springs_that_do_not_swing_in_the_window_are_named(live, capsys):
    class Swings:
        def swing(self, actor, time):
            pass

    actor = viewer.animate(bar("braid"), np.zeros((2, 2, 3)))
    live.add(actor)
    assert capsys.readouterr().err == ""
    live.remove(actor)
    actor.springs = Swings()
    live.add(actor)
    note = "viewer: motion: its spring joints do not swing in the window\n"
    assert capsys.readouterr().err == note
    # Once, although hiding a part sends the actor again.
    actor.hidden_parts = frozenset([0])
    live.update()
    assert capsys.readouterr().err == ""
    live.show(viewer.Scene([actor]))
    assert capsys.readouterr().err == note


def test_threads_take_turns_quickly_while_a_window_listens(tmp_path):
    usual = sys.getswitchinterval()
    with screen_at(tmp_path / "window.json"):
        assert sys.getswitchinterval() == pytest.approx(1e-3)
    assert sys.getswitchinterval() == pytest.approx(usual)
    assert usual > 1e-3


def test_random_bytes_leave_the_server_at_work(screen):
    rng, known = random.Random(11), prove(screen.path)
    for number in range(30):
        data = bytearray(hello() if number % 2 else packed(pose_of()))
        for _ in range(rng.randrange(6)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        data = bytes(data[: rng.randrange(len(data))])
        with socket.create_connection(("127.0.0.1", screen.server.port), 10) as stream:
            if number % 2 == 0:
                stream.sendall(hello())
                stream.sendall(known(read(receiver(stream))))
                read(receiver(stream))
            stream.sendall(data)
    with viewer.connect(screen.path) as live:
        assert live.selection == ("first",)
    screen.wait(lambda: screen.server.counts.clients == 0)


def test_of_many_poses_the_latest_is_shown(tmp_path):
    path = tmp_path / "window.json"
    server = Server(path)
    first = viewer.Actor(bar("first"))
    server.follow([first])
    server.start()
    try:
        found = raw(SimpleNamespace(server=server), hello(), prove(path), *[packed(pose_of())] * 50)
        assert [each.do for each in found] == ["ok"] * 52
        assert list(server.take_poses()) == [1]
    finally:
        server.close()


@pytest.mark.parametrize("name", ["pose", "placement"])
def test_error_of_the_thread_is_raised_by_update(screen, live, capsys, name):
    actor = live.add(bar())
    if name == "pose":
        actor.pose.dofs[:] = np.nan
    else:
        actor.placement[0, 3] = np.nan
    deadline = time.monotonic() + 10
    while not live._problem and time.monotonic() < deadline:
        time.sleep(0.01)
    with pytest.raises(ViewerError, match="finite"):
        live.update()
    assert "finite" in capsys.readouterr().err
    actor.pose.dofs, actor.placement = np.zeros(6), np.eye(4)
    live.update()


def test_window_goes_on_once_a_pose_fits_again(screen, live, monkeypatch, capsys):
    monkeypatch.setattr("viewer.live.program._RETRY_SECONDS", 0.02)
    first = live["first"]
    first.pose.figure_translation[1] = np.nan
    deadline = time.monotonic() + 10
    while screen.server.counts.refused < 3 and time.monotonic() < deadline:
        time.sleep(0.01)
    first.pose.figure_translation[1] = 3.0
    screen.wait(is_at(screen, [2.0, 3.0, 0.0]))
    live.update()
    assert capsys.readouterr().err.count("finite") == 1


def test_moving_a_body_does_not_compute_its_shape_again(screen, live, monkeypatch):
    shapes = BlendShapes(("height",), np.ones((1, 3, 3)), space=Upwards())
    actor = live.add(replace(bar(), blend_shapes=shapes))
    monkeypatch.setattr("viewer.live.program.shaped", None)
    actor["joint_1"] = [0.0, 0.0, QUARTER]
    live.update()
    screen.wait(is_at(screen, [1.0, 1.0, 0.0]))


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_folder_that_others_can_write_is_refused(tmp_path, monkeypatch):
    monkeypatch.delenv("VIEWER_CONNECTION_FILE", raising=False)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    usual = file_path()
    assert stat.S_IMODE(usual.parent.stat().st_mode) == 0o700
    assert usual.is_relative_to(tmp_path)
    usual.parent.chmod(0o777)
    with pytest.raises(ViewerError, match="nobody else can write"):
        file_path()


def test_machine_without_a_runtime_folder_is_not_warned_about(tmp_path, monkeypatch):
    monkeypatch.delenv("VIEWER_CONNECTION_FILE", raising=False)

    def warned(*_, **named):
        warnings.warn("XDG_RUNTIME_DIR is not set", UserWarning, stacklevel=2)
        return str(tmp_path / "viewer")

    monkeypatch.setattr(platformdirs, "user_runtime_dir", warned)
    assert file_path() == tmp_path / "viewer" / "window.json"
