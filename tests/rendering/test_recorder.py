"""The recorder: frames that match single images, unchanged scenes, and a clean end at any time."""

import threading
import time

import numpy as np
import pytest
from rendering.drawn_figures import arm
from rendering.moving import moving_arm

from viewer.errors import OutputError, ViewerError
from viewer.progress import receiving
from viewer.rendering.camera import Camera
from viewer.rendering.gpu.target import Readback
from viewer.rendering.offscreen import Offscreen
from viewer.rendering.options import DisplayOptions
from viewer.rendering.recorder import Follow, Recording, record
from viewer.rendering.renderer import Renderer
from viewer.rigs.scene import Actor, Scene, pose_actors, scene_box

SIZE = 64, 48
FULL = OutputError("disk full")
TIMES = np.array([0.0, 0.1, 0.2, 0.35, 0.7, 1.0])


class Kept:
    """A sink that stores its frames and can be made to fail."""

    def __init__(self, workers=1, n_samples=0, fails_at=None, problem=FULL):
        self.workers, self.n_samples, self.fails_at = workers, n_samples, fails_at
        self.problem = problem
        self.frames: dict[int, np.ndarray] = {}
        self.seen: list[np.ndarray] = []
        self.ended: list[str] = []
        self.threads: set[int] = set()

    def look(self, pixels):
        assert not self.frames
        self.seen.append(pixels.copy())

    def write(self, frame, pixels):
        if frame == self.fails_at:
            raise self.problem
        self.threads.add(threading.get_ident())
        self.frames[frame] = pixels.copy()

    def close(self):
        if self.fails_at == "close":
            raise self.problem
        self.ended.append("close")

    def abort(self):
        self.ended.append("abort")


@pytest.fixture(scope="module")
def offscreen():
    with Offscreen() as kept:
        yield kept
        with kept.context:
            assert kept.context.error == "GL_NO_ERROR"


@pytest.fixture
def scene() -> Scene:
    return Scene([moving_arm()])


def recording_of(scene, **changes) -> Recording:
    camera = Camera(np.array([1.5, 0.0, 0.0]), 12.0)
    values = {"options": DisplayOptions(grid=False), "box": np.array([[-2.0] * 3, [6.0] * 3])}
    return Recording(scene, TIMES, camera, SIZE, **{**values, **changes})


def run(offscreen, recording, sink) -> list[int]:
    with offscreen.context:
        return list(record(recording, offscreen.renderer, sink))


def one_by_one(offscreen, recording, cameras=None) -> list[np.ndarray]:
    """Return single images that are posed here and rendered without the recorder."""
    pictures = []
    actor = moving_arm()
    for index, seconds in enumerate(recording.times):
        pose_actors([actor], float(seconds))
        camera = recording.camera if cameras is None else cameras[index]
        scene = Scene([actor])
        picture = offscreen.render(scene, SIZE, camera, recording.options, recording.box)
        pictures.append(picture)
    return pictures


@pytest.mark.parametrize("background", ["gradient", "transparent"])
def test_frames_match_single_images(offscreen, scene, background):
    options = DisplayOptions(background=background, grid=False)
    recording, sink = recording_of(scene, options=options), Kept()
    run(offscreen, recording, sink)
    assert list(sink.frames) == list(range(len(TIMES))) and sink.ended == ["close"]
    for index, wanted in enumerate(one_by_one(offscreen, recording)):
        assert (sink.frames[index] == wanted).all(), index
    assert (sink.frames[0] != sink.frames[2]).any()


def test_recording_does_not_change_the_scene(offscreen, scene):
    actor = scene.actors[0]
    actor.pose.dofs[4] = 0.25
    before = actor.pose.copy()
    run(offscreen, recording_of(scene), Kept())
    assert scene.actors == [actor] and actor.is_present and scene.time is None
    assert (actor.pose.dofs == before.dofs).all()
    assert (actor.pose.figure_translation == before.figure_translation).all()


def test_absent_actors_are_not_drawn(offscreen, scene):
    """Frame 5 of the motion, from 0.5 s to 0.6 s, is missing."""
    options = DisplayOptions(background="transparent", grid=False)
    sink = Kept()
    recording = recording_of(scene, options=options)
    recording.times = np.array([0.4, 0.55, 0.6])
    run(offscreen, recording, sink)
    drawn = [bool(sink.frames[frame].any()) for frame in range(3)]
    assert drawn == [True, False, True]
    recording.interpolate = True
    filled = Kept()
    run(offscreen, recording, filled)
    assert filled.frames[1].any()


def test_static_scene_keeps_its_pose(offscreen, scene):
    scene.actors[0].pose.dofs[5] = 0.7
    sink = Kept()
    recording = recording_of(scene, moves=False)
    run(offscreen, recording, sink)
    wanted = offscreen.render(scene, SIZE, recording.camera, recording.options, recording.box)
    assert all((sink.frames[frame] == wanted).all() for frame in range(len(TIMES)))


def test_turntable_is_a_seamless_loop(offscreen):
    scene = Scene([Actor(arm(3))])
    recording = recording_of(scene, moves=False, turntable=360.0)
    recording.times, recording.camera.azimuth = np.zeros(8), 170.0
    sink = Kept()
    run(offscreen, recording, sink)
    for frame in range(8):
        camera = recording.camera.copy()
        camera.azimuth += 45.0 * frame  # the eighth step would be the first frame again
        wanted = offscreen.render(scene, SIZE, camera, recording.options, recording.box)
        differs = (sink.frames[frame] != wanted).any(axis=2)
        assert differs.mean() < 0.01  # 530 and 170 degrees differ in the last bit of the sine
    assert recording.camera.azimuth == 170.0


def test_camera_follows_its_target(offscreen, scene):
    """The arm moves along x at 2 units per second, without rotating."""
    straight = moving_arm(turns=False)
    options = DisplayOptions(background="transparent", grid=False)
    recording = recording_of(Scene([straight]), options=options)
    recording.times = np.array([0.0, 0.3, 0.4])
    fixed, followed = Kept(), Kept()
    run(offscreen, recording, fixed)
    recording.follow = Follow(0, 1, np.array([1.0, 0.0, 0.0]))  # the position of joint 1
    run(offscreen, recording, followed)
    assert (fixed.frames[0] != fixed.frames[2]).any()
    assert (fixed.frames[0] == followed.frames[0]).all()
    for frame in (1, 2):
        differs = (followed.frames[frame] != followed.frames[0]).any(axis=2)
        assert differs.mean() < 0.02  # a different order of summation changes edges in the last bit


def test_camera_does_not_move_while_its_actor_is_absent(offscreen, scene):
    marker = Actor(arm(2))  # the camera does not move
    recording = recording_of(Scene([moving_arm(turns=False), marker]))
    recording.times = np.array([0.4, 0.55])
    recording.follow = Follow(0, 0, np.zeros(3))
    recording.options.background = "transparent"
    sink = Kept()
    run(offscreen, recording, sink)
    camera = recording.camera.copy()
    camera.target = camera.target + np.array([0.8, 0.0, 0.0])  # same as at 0.4 s
    wanted = offscreen.render(Scene([marker]), SIZE, camera, recording.options, recording.box)
    assert (sink.frames[1] == wanted).all()


def test_progress_counts_every_frame(offscreen, scene):
    said = []
    with receiving(lambda *step: said.append(step)):
        steps = run(offscreen, recording_of(scene), Kept())
    assert steps[: len(TIMES)] == [1, 2, 3, 4, 5, 6] and steps[-1] == 6
    assert said == [(done, 6, "frames", "") for done in range(1, 7)]


def test_sampled_frames_are_rendered_before_the_first_frame(offscreen, scene):
    sink = Kept(n_samples=3)
    run(offscreen, recording_of(scene), sink)
    assert len(sink.seen) == 3
    for seen, frame in zip(sink.seen, (0, 2, 5), strict=True):  # 2.5 is rounded to even
        assert (seen == sink.frames[frame]).all()


def test_more_samples_than_frames_sample_all_frames(offscreen, scene):
    sink = Kept(n_samples=12)
    run(offscreen, recording_of(scene), sink)
    assert len(sink.seen) == len(TIMES)


def test_frames_are_written_while_rendering(offscreen, scene):
    sink = Kept(workers=3)
    run(offscreen, recording_of(scene), sink)
    assert sorted(sink.frames) == list(range(len(TIMES)))
    assert threading.get_ident() not in sink.threads


@pytest.mark.parametrize("n_frames", [0, 1, 2])
def test_recordings_of_few_frames_are_written(offscreen, scene, n_frames):
    recording, sink = recording_of(scene), Kept()
    recording.times = TIMES[:n_frames]
    run(offscreen, recording, sink)
    assert len(sink.frames) == n_frames and sink.ended == ["close"]


def test_sizes_may_change_from_one_recording_to_the_next(offscreen, scene):
    for size in ((33, 17), (64, 48), (33, 17)):
        recording, sink = recording_of(scene), Kept(n_samples=2)
        recording.size = size
        run(offscreen, recording, sink)
        assert sink.frames[0].shape == (size[1], size[0], 4)


@pytest.mark.parametrize("at", [0, 2, 5, "close"])
def test_failing_sink_ends_the_recording(offscreen, scene, at):
    sink = Kept(fails_at=at)
    with pytest.raises(OutputError, match="disk full"):
        run(offscreen, recording_of(scene), sink)
    assert sink.ended == ["abort"]
    run(offscreen, recording_of(scene), after := Kept())  # no frame remains
    assert after.ended == ["close"]


def test_interruption_aborts_the_sink(offscreen, scene):
    sink = Kept(fails_at=3, problem=KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        run(offscreen, recording_of(scene), sink)
    assert sink.ended == ["abort"]


@pytest.mark.parametrize("n_steps", [1, 3, 6])
def test_closing_the_generator_aborts_the_sink(offscreen, scene, n_steps):
    sink = Kept()
    before = threading.active_count()
    with offscreen.context:
        steps = record(recording_of(scene), offscreen.renderer, sink)
        for _ in range(n_steps):
            next(steps)
        steps.close()
        assert offscreen.context.error == "GL_NO_ERROR"
    assert sink.ended == ["abort"] and threading.active_count() == before


def test_other_scenes_may_be_rendered_between_steps(offscreen, scene):
    recording, sink = recording_of(scene), Kept()
    other = Scene([Actor(arm(2))])
    with Offscreen() as window:
        with window.context:
            steps = record(recording, window.renderer, sink)
            for _ in steps:
                target = window.target((40, 30), 4)
                window.renderer.draw(
                    other, recording.camera, recording.options, target, scene_box(other)
                )
                target.resolve()
                assert target.read().any()
        for index, wanted in enumerate(one_by_one(window, recording)):
            assert (sink.frames[index] == wanted).all(), index


def test_few_frames_are_queued_for_a_slow_sink(offscreen, scene):
    class Slow(Kept):
        def write(self, frame, pixels):
            gate.wait(60)
            super().write(frame, pixels)

    gate, sink = threading.Event(), Slow()
    recording = recording_of(scene)
    recording.times = np.linspace(0.0, 1.0, 12)
    drawn = 0
    with offscreen.context:
        for drawn in record(recording, offscreen.renderer, sink):
            if drawn == 2:  # one is being written and one is queued; the next must wait
                threading.Timer(0.2, gate.set).start()
            assert drawn - len(sink.frames) <= 3
    assert drawn == 12 == len(sink.frames)


@pytest.mark.parametrize("workers", [1, 3])
def test_memory_holds_a_frame_per_worker_and_two_more(offscreen, scene, monkeypatch, workers):
    """The sink waits until all that may be held is held, and gives time to exceed it."""
    held, most, given, foreign, full = 0, 0, [], [], threading.Event()
    begin, end, free = Readback.begin, Readback.end, Readback.free

    def counted_begin(self):
        nonlocal held, most
        begin(self)
        held += 1
        most = max(most, held)
        if held == workers + 2:
            full.set()

    def kept_end(self):
        given.append(end(self))
        return given[-1]

    def counted_free(self):
        nonlocal held
        free(self)
        held -= 1

    class Slow(Kept):
        def write(self, frame, pixels):
            assert full.wait(60)
            time.sleep(0.02)
            if not np.shares_memory(pixels, given[frame]):
                foreign.append(frame)
            super().write(frame, pixels)

    for name, function in (("begin", counted_begin), ("end", kept_end), ("free", counted_free)):
        monkeypatch.setattr(Readback, name, function)
    recording, sink = recording_of(scene), Slow(workers)
    recording.times = np.linspace(0.0, 1.0, 12)
    run(offscreen, recording, sink)
    assert len(sink.frames) == 12 and most == workers + 2
    assert not foreign  # the sink got the driver's memory, not a copy


def test_next_frame_is_submitted_before_the_last_one_is_waited_for(offscreen, scene, monkeypatch):
    events = []

    def noted(kind, name):
        function = getattr(kind, name)

        def call(self, *arguments):
            events.append(name)
            return function(self, *arguments)

        monkeypatch.setattr(kind, name, call)

    for kind, name in ((Renderer, "draw"), (Readback, "submit"), (Readback, "end")):
        noted(kind, name)
    recording = recording_of(scene)
    recording.times = TIMES[:3]
    run(offscreen, recording, Kept())
    # Each copy is submitted too, before the next frame is prepared.
    first, between, last = "draw submit", "submit draw submit end", "submit end"
    assert events == f"{first} {between} {between} {last}".split()


def test_unsupported_size_is_refused(offscreen, scene):
    recording, sink = recording_of(scene), Kept()
    recording.size = (1_000_000, 10)
    with pytest.raises(ViewerError, match="image size: expected 1 to"):
        run(offscreen, recording, sink)
    assert sink.ended == ["abort"]
