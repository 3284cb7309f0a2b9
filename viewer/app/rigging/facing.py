"""Choice of the front of a target whose front and back look alike: a picture of each fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import moderngl
import numpy as np
from imgui_bundle import imgui

from viewer.app.core.reasons import no_job_room
from viewer.app.core.state import AppState
from viewer.app.core.theme import accent
from viewer.app.core.widgets import button, disabled, explain, note_item, warning
from viewer.app.rigging.placing import placing_now
from viewer.app.rigging.rigging import Placing, Rigging, target_mesh
from viewer.autorig.alignment.orientation_search import AXES, axis_direction
from viewer.autorig.alignment.surface_alignment import DEFAULT_UP, misfit
from viewer.data_classes import dataclass
from viewer.errors import ViewerError
from viewer.rendering.camera import facing_camera, fit
from viewer.rendering.gpu.program import Programs
from viewer.rendering.gpu.target import Target
from viewer.rendering.options import DisplayOptions
from viewer.rendering.renderer import Renderer
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import rest_pose
from viewer.rigs.scene import Actor, Scene, scene_box, scene_points
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skin import skin_from_entries
from viewer.rigs.skinning import joint_matrices

_PIXELS = (360, 440)
"""Size of a picture; panels show it smaller."""
_Then = Callable[[AppState], None]


@dataclass(slots=True)
class FacingChoice:
    """State of the question which way the target faces."""

    waiting: _Then | None = None
    """What goes on once a picture has been clicked."""
    scrolls: int = 0
    """Number of frames in which the panel still scrolls to the pictures."""
    textures: tuple[int, ...] = ()
    """IDs of the pictures' textures, in the order of ``fronts_now``."""


def ask_facing(state: AppState, then: _Then | None = None) -> None:
    """Ask in the Rig panel which way the target faces; go on with ``then`` after the answer."""
    choice = state.of(FacingChoice)
    choice.waiting, choice.scrolls = then, 2
    state.say_status("Front and back look alike: click a picture in the Rig panel")


def fronts_now(state: AppState) -> list[Placing]:
    """Return both placements of a template whose target looks alike from behind, or none."""
    placing = placing_now(state)
    if placing is None or placing.other is None:
        return []
    return sorted((placing, placing.other), key=lambda one: AXES.index(one.front))


def choose_front(state: AppState, front: str) -> None:
    """Keep the fit that faces an axis, as a step of the undo history, and go on."""
    placing, choice = placing_now(state), state.of(FacingChoice)
    if placing is None or placing.other is None:
        return
    one, two = placing, placing.other
    if front != one.front:
        one, two = two, one
    state.of(Rigging).placing = replace(one.answered, other=replace(two.answered, other=None))
    state.history.name = f"face {front}"
    state.say_status(f"Front: {front}")
    then, choice.waiting = choice.waiting, None
    if then is not None:
        then(state)


def draw_fronts(state: AppState) -> None:
    """Draw the pictures of both fits side by side; a click on one chooses it."""
    choice, placing, fits = state.of(FacingChoice), placing_now(state), fronts_now(state)
    if placing is None:
        return
    if placing.asks:
        warning("Front and back look alike. Click the picture that shows the front:")
    else:
        imgui.text_wrapped(
            "Front and back look alike. To turn the rig, click the other picture and press Run:"
        )
    style = imgui.get_style()
    border = 2.0 * style.frame_padding.x
    width = 0.5 * (imgui.get_content_region_avail().x - style.item_spacing.x) - border
    width = min(max(width, 1.0), float(_PIXELS[0]))
    size = (width, width * _PIXELS[1] / _PIXELS[0])
    with disabled(state, no_job_room(state)):
        for column, (one, texture) in enumerate(zip(fits, choice.textures, strict=False)):
            if column:
                imgui.same_line()
            imgui.begin_group()
            is_chosen = one is placing and not placing.asks
            if is_chosen:
                imgui.push_style_color(imgui.Col_.button, accent())
            # Textures have their first row at the bottom.
            picture = imgui.ImTextureRef(texture)
            pressed = imgui.image_button(
                f"##front {one.front}", picture, size, (0.0, 1.0), (1.0, 0.0)
            )
            if is_chosen:
                imgui.pop_style_color()
            note_item(state, f"front {one.front}")
            explain("the skeleton in the mesh, seen from its front")
            imgui.text_unformatted(f"front {one.front}{_gap_text(one)}")
            imgui.end_group()
            if pressed and not no_job_room(state):
                choose_front(state, one.front)
    if choice.waiting is not None:
        imgui.text_wrapped("Rigging goes on with the picture that you click.")
        if button(state, "Cancel###cancel facing"):
            choice.waiting = None
            state.say_status("Cancelled")


def _gap_text(placing: Placing) -> str:
    """Return the gap between the surfaces, which is less telling than the pictures."""
    found = placing.alignment
    return "" if found is None else f", gap {100.0 * misfit(found, False):.2f} %"


class FacingPictures:
    """Draws both fits into textures whenever there are other ones."""

    def __init__(self, programs: Programs) -> None:
        self._programs = programs
        self._drawn: list[object] = []
        self._targets: list[Target] = []
        self._old: list[Target] = []

    def draw(self, state: AppState) -> None:
        """Draw the pictures if the Rig panel has new ones to show; called in each frame."""
        self._release_old()
        fits, choice = fronts_now(state), state.of(FacingChoice)
        wanted: list[object] = [one.similarity for one in fits]
        if not fits:
            choice.waiting = None  # undone, or another target was chosen
        if len(wanted) == len(self._drawn) and all(map(_is_same, wanted, self._drawn)):
            return
        # Panels of this frame may show the textures: they are released in the next one.
        self._drawn, self._old, self._targets = wanted, self._targets, []
        choice.textures = ()
        if not fits:
            return
        renderer = Renderer(self._programs)
        try:
            for one in fits:
                target = Target(self._programs.context, _PIXELS, 4)
                self._targets.append(target)
                _draw_front(state, one, renderer, target)
            choice.textures = tuple(int(target.texture.glo) for target in self._targets)
        except ViewerError as problem:
            state.error = str(problem)
        finally:
            renderer.release()

    def release(self) -> None:
        """Release everything, as when the window is closed."""
        self._old += self._targets
        self._targets = []
        self._release_old()

    def _release_old(self) -> None:
        for target in self._old:
            target.release()
        self._old.clear()


def _is_same(one: object, other: object) -> bool:
    return one is other


def _draw_front(state: AppState, placing: Placing, renderer: Renderer, target: Target) -> None:
    """Draw the skeleton in the mesh, seen from the front, slightly left and above."""
    scene = front_scene(target_mesh(state), placing)
    camera = facing_camera("+z", "y")
    fit(camera, scene_points(scene, "both"), _PIXELS[0] / _PIXELS[1])
    options = DisplayOptions(show="both", xray=True, grid=False, bones="octahedra")
    options.skeleton_opacity = 1.0
    renderer.draw(scene, camera, options, target, scene_box(scene))
    target.resolve()
    target.texture.filter = (moderngl.LINEAR, moderngl.LINEAR)


def front_scene(mesh: Mesh, placing: Placing) -> Scene:
    """Return the mesh and the fitted joints, turned so that they face +z and stand on x and z."""
    template = placing.fitted
    assert template is not None  # only fits are compared
    places = placing.similarity.apply(joint_matrices(template.figure, template.pose)[:, :3, 3])
    own = template.figure.require_skeleton()
    # Nothing is posed here: all vertices move with the first root.
    skeleton = ball_skeleton(own.names, own.parents, places)
    inverse = np.stack([translation_matrix(-place) for place in places])
    count, root = mesh.n_vertices, int(np.flatnonzero(own.parents < 0)[0])
    skin = skin_from_entries(
        count, np.arange(count, dtype=np.int32), np.full(count, root), np.ones(count), inverse
    )
    figure = Figure("front", mesh, skeleton, skin)
    ahead = axis_direction(placing.front)
    up = axis_direction(placing.settings.up or DEFAULT_UP)
    turned = np.eye(4)
    turned[:3, :3] = np.stack([np.cross(up, ahead), up, ahead])
    return Scene([Actor(figure, rest_pose(skeleton), placement=turned)])
