"""A context and its programs, which outlive the renderers that use them."""

import threading

import moderngl
import numpy as np

import viewer
from viewer.rendering.gpu.context import Graphics, thread_graphics
from viewer.rendering.offscreen import Offscreen, default_camera
from viewer.rendering.options import DisplayOptions
from viewer.rig.scene import scene_box

SIZE = (40, 30)


def picture(offscreen):
    scene = viewer.load()
    camera = default_camera(scene, SIZE)
    return offscreen.render(scene, SIZE, camera, DisplayOptions(), scene_box(scene))


def test_renderers_that_share_a_context_draw_equal_images():
    with Offscreen() as alone:
        expected = picture(alone)
    graphics = Graphics()
    for _ in range(2):
        with Offscreen(graphics=graphics) as borrowing:
            np.testing.assert_array_equal(picture(borrowing), expected)
    with graphics.context:
        assert graphics.context.error == "GL_NO_ERROR"
    graphics.release()
    assert isinstance(graphics.context.mglo, moderngl.InvalidObject)


def test_programs_are_compiled_once_for_all_renderers():
    graphics = Graphics()
    with Offscreen(graphics=graphics) as borrowing, graphics.context:
        program = graphics.programs.drawing("motion_path")
    with Offscreen(graphics=graphics) as borrowing, graphics.context:
        assert borrowing.renderer.programs.drawing("motion_path") is program
        assert not isinstance(program.mglo, moderngl.InvalidObject)
    graphics.release()


def test_each_thread_has_a_separate_context():
    found = []
    mine = thread_graphics()

    def look():
        found.extend([thread_graphics(), thread_graphics()])

    thread = threading.Thread(target=look)
    thread.start()
    thread.join()
    assert found[0] is found[1] and found[0] is not mine is thread_graphics()
