"""Rig panel: choice of target and template, alignment, matching, rigging, and results."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.fields import begin_field, in_row
from viewer.app.core.reasons import no_job_room
from viewer.app.core.saved_work import SavedWork
from viewer.app.core.state import AppState
from viewer.app.core.text_fields import number_field
from viewer.app.core.widgets import (
    button,
    choice,
    count_slider,
    disabled,
    draw_setting,
    explain,
    note_item,
    plain_zero,
    radio,
    same_line_if_room,
    slider,
    warning,
)
from viewer.app.files.file_choice import FileDialog
from viewer.app.files.files import ask_for_files
from viewer.app.rigging.facing import FacingChoice, draw_fronts, fronts_now
from viewer.app.rigging.joint_editing.section import draw_section
from viewer.app.rigging.placing import (
    aligned_template,
    box_fit,
    is_posed_since,
    move_by_hand,
    placing_now,
    posed_template,
    similarity_now,
)
from viewer.app.rigging.results import MATCH_COLORS, draw_results, show_colors
from viewer.app.rigging.rigging import (
    GHOSTS,
    SHAPE,
    TOOLS,
    RigChoices,
    Rigging,
    Template,
    choose_target,
    choose_template,
    compared_methods,
    current_template,
    method_now,
    methods_now,
    no_placing,
    no_target,
    refresh,
    target_mesh,
    targets,
    template_texts,
)
from viewer.app.rigging.tools import choose_rig_tool
from viewer.app.rigging.work import (
    landmark_settings,
    start_adding,
    start_align,
    start_match,
    start_reading,
    start_run,
)
from viewer.autorig.alignment.similarity import Similarity
from viewer.autorig.alignment.surface_alignment import AlignedBy, Alignment, AlignmentSettings
from viewer.autorig.settings import METHODS, TransferMethod
from viewer.errors import ViewerError
from viewer.formats import MESHES
from viewer.loading.mesh_sequence import ARCHIVES
from viewer.loading.placing import placed_like
from viewer.phrases import capitalized, printable
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.rotation import axis_rotations, matrix_to_euler
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.mesh import bounding_box
from viewer.rigs.scene import Actor, actor_points, free_title

_MOST_ITERATIONS, _MOST_INFLUENCES = 50, 16
_ONLY: dict[str, tuple[TransferMethod, ...]] = {
    "smoothing": ("robust", "heat", "voxel"),
    "max_influences": ("robust", "heat", "voxel"),
}
"""Methods that use an option; the options not listed are for ``robust`` only."""
_ADVANCED = ("refines", "joints", "smoothing", "max_influences", "correctives")
_GAP = 1.2  # distance of the template from other actors, relative to its width
_FEWEST = 3  # minimum number of landmarks
_DOUBTFUL = 0.03  # error relative to the target's size, as in the report
_STRETCHED = "stretched, pose kept"
_METHODS: dict[AlignedBy, str] = {
    "in place": "about the shared origin",
    "search": "by closest points",
    "fit": "pose and limbs fitted",
    "landmarks": "by landmarks",
    "given": "by hand",
}
"""Labels of the alignment methods."""
_POSES = "; joints are rotated and limbs resized if that fits much better"
_FITS = (
    "; joints are rotated and limbs resized, or the whole template is stretched, if that fits much "
    "better"
)


def draw(state: AppState) -> None:
    """Draw the panel."""
    rigging = state.of(Rigging)
    refresh(state)
    _draw_sources(state)
    why = no_target(state)
    if why:
        imgui.text_wrapped(f"{capitalized(why)}.")
    if _section("Edit skeleton", "joints placed and moved by hand"):
        draw_section(state)
    if rigging.template_key == SHAPE:
        with disabled(state, why):
            if _section("Shape", "a skeleton is found in the shape of the target"):
                _draw_shape(state)
    else:
        with disabled(state, why or no_placing(state)):
            if _section("Align", "align the template with the target"):
                _draw_alignment(state)
            if _section("Match", "conditions for using the template's weights unchanged"):
                _draw_match(state)
    with disabled(state, why):
        if _section("Rig", "transfer of weights, joints and rest pose"):
            _draw_run(state)
    if fronts_now(state):
        _draw_front(state)
    if not rigging.results:
        return
    if rigging.scrolls:
        # The height of the section is known only from the second frame on.
        rigging.scrolls -= 1
        imgui.set_scroll_here_y(0.0)
    if _section("Result", "the rigged mesh, in place of the target"):
        draw_results(state)


def _draw_front(state: AppState) -> None:
    """Draw the choice of the front, and scroll to it if it has just been asked for."""
    facing = state.of(FacingChoice)
    if facing.scrolls:
        facing.scrolls -= 1
        imgui.set_scroll_here_y(0.0)
        imgui.set_next_item_open(True)
    if _section("Front", "front and back of the target look alike"):
        draw_fronts(state)


def _section(title: str, text: str) -> bool:
    opened = imgui.collapsing_header(
        f"{title}###rig section {title}", imgui.TreeNodeFlags_.default_open
    )
    explain(text)
    return opened


def _draw_sources(state: AppState) -> None:
    """Draw the choice of target and template."""
    view, found, why = state.of(Rigging), targets(state), no_job_room(state)
    names = {str(row): printable(actor.name, 60) for row, actor in enumerate(found)}
    rows = [str(row) for row, actor in enumerate(found) if actor is view.target]
    with disabled(state, "" if found else "no mesh without a rig"):
        chosen = choice(state, "Target", rows[0] if rows else "", names or {"": "none"})
    if found and chosen in names:
        choose_target(state, found[int(chosen)])
    if button(state, "Add mesh…", why):
        suffixes = (*MESHES, *ARCHIVES)
        title = f"Add a mesh to rig, or all frames of one that moves: {', '.join(suffixes)}"
        ask_for_files(state, start_adding, title, suffixes, more=_draw_motion, more_rows=3.0)
    explain("add a mesh without a rig to this scene, or find bones in the frames of a moving one")
    with disabled(state, why):
        key = choice(state, "Template", view.template_key, template_texts(state))
    if key != view.template_key:
        choose_template(state, key)
    if button(state, "Template file…", why):
        ask_for_files(state, start_reading, "Template: any rigged figure, or a skeleton")
    explain(
        "any figure that can be opened: a body model, .npz, or .skel and .skin together; or a "
        "skeleton to which the target is bound"
    )
    template = current_template(state)
    # A template that has not been read yet has the same controls, so that buttons do not move.
    if template is None or template.actor is None:
        same_line_if_room("Pose it…")
        refuses = no_target(state) or why
        if view.template_key == SHAPE:
            refuses = "the skeleton is found when the target is rigged"
        if button(state, "Pose it…", refuses):
            if template is None:
                start_reading(state, then=_add_template)
            else:
                _add_template(state)
        explain("add the template next to the target in order to pose it like the target")
    imgui.push_text_wrap_pos(0.0)
    text = "read on first use"
    if view.template_key == SHAPE:
        text = "for what is no person and no quadruped: spiders, octopuses, hands, robot arms"
    if template is not None:
        n_joints = template.figure.require_skeleton().n_joints
        mesh = template.figure.mesh
        size = "no mesh" if mesh is None else f"{mesh.n_vertices:,} vertices"
        pose = "in its current pose" if template.actor is not None else "in its file's pose"
        text = f"{n_joints} joints, {size}, {pose}"
    imgui.text_disabled(text)
    imgui.pop_text_wrap_pos()


def _draw_motion(state: AppState, _dialog: FileDialog) -> None:
    """Draw the settings of bones that are found in the frames of a moving mesh."""
    choices = state.of(Rigging).choices
    text = "number of bones for the frames of a moving mesh; 0 for as many as the tolerance needs"
    draw_setting(state, "Bones", choices, "bones", text)
    why = "" if choices.bones == 0 else "for a number of bones of 0"
    text = "RMS error of the worst frame, relative to the size of the mesh"
    draw_setting(state, "Tolerance", choices, "tolerance", text, why)


def _add_template(state: AppState) -> None:
    """Add the template to the scene, to the right of the other actors."""
    template = current_template(state)
    assert template is not None  # the template has been read
    actor = Actor(template.figure, template.pose.copy(), template.clip)
    actor.called = free_title(state.scene.actors, actor.title)
    state.say(*placed_like(state.scene, actor))
    span = bounding_box(actor_points(actor))[:, 0]
    edge = max(
        (actor_points(one)[:, 0].max() for one in state.scene.actors if one.is_drawn), default=0.0
    )
    shift = edge - span[0] + (_GAP - 1.0) * (span[1] - span[0])
    actor.placement = translation_matrix(np.array([shift, 0.0, 0.0])) @ actor.placement
    state.scene.actors.append(actor)
    state.of(SavedWork).add_actors([actor])  # the template was read from files
    state.choose_actor(len(state.scene.actors) - 1)
    choose_template(state, f"actor {id(actor)}")


def _draw_match(state: AppState) -> None:
    """Draw the conditions for a match, and the fraction of vertices that match."""
    view = state.of(Rigging)
    choices = view.choices
    why = _unused(state, "max_distance")
    with disabled(state, why):
        percent = 100.0 * choices.max_distance
        moved = slider(state, "Max. distance", percent, 0.1, 30.0, "%.1f %%")
        explain("maximum distance between the surfaces, relative to the target's size", why)
        choices.max_distance = min(max(moved, 0.0), 1000.0) / 100.0
        moved = slider(state, "Max. angle", choices.max_angle, 0.0, 180.0, "%.0f\N{DEGREE SIGN}")
        explain("maximum angle between the normals of the surfaces", why)
        choices.max_angle = min(max(moved, 0.0), 180.0)
    why = no_job_room(state) or ("" if placing_now(state) else "align the template first")
    if button(state, "Show match", why):
        start_match(state)
    if view.match_fraction is None:
        return
    same_line_if_room("100.0 % of the vertices match")
    imgui.text_unformatted(f"{100.0 * view.match_fraction:.1f} % of the vertices match")
    options = state.options
    now = options.scalar if options.shading == "scalar" and options.scalar in MATCH_COLORS else ""
    chosen = choice(state, "Colours", now, {"": "none", **MATCH_COLORS})
    if chosen != now:
        show_colors(state, chosen)


def _draw_run(state: AppState) -> None:
    """Draw the settings of the transfer, and the buttons that start it."""
    choices = state.of(Rigging).choices
    method = method_now(state)
    chosen = choice(state, "Method", method, {name: name for name in methods_now(state)})
    explain(METHODS[method])
    if chosen != method:
        choices.method = method = chosen
    _draw_advanced(state, choices)
    why = no_job_room(state)
    if button(state, "Run", why):
        start_run(state, (method,))
    explain("rig the target; aligns the template first if necessary")
    same_line_if_room("Compare methods")
    if button(state, "Compare methods", why):
        start_run(state, compared_methods(method))
    both = " and ".join(compared_methods(method))
    explain(f"run {both}; A cycles through the original mesh and both results")


def _draw_advanced(state: AppState, choices: RigChoices) -> None:
    """Draw the rarely used settings, collapsed; the label shows the number of changed settings."""
    usual = RigChoices()
    changed = sum(getattr(choices, name) != getattr(usual, name) for name in _ADVANCED)
    text = f"Advanced ({changed} changed)" if changed else "Advanced"
    opened = imgui.tree_node(f"{text}###rig advanced")
    note_item(state, "rig advanced")
    if not opened:
        return
    why = _unused(state, "joints")
    with disabled(state, why):
        text = "refine the result of the search or of the landmarks by closest points"
        draw_setting(state, "Refine alignment", choices, "refines", text, why)
        text = "surface: joints are placed by the surface around them; alignment: only by the "
        draw_setting(state, "Joints##rig", choices, "joints", f"{text}alignment", why)
    why = _unused(state, "smoothing")
    with disabled(state, why):
        limits = (0, _MOST_ITERATIONS)
        count = count_slider(state, "Smoothing", choices.smoothing, limits)
        explain("smoothing iterations for inpainted weights", why)
        choices.smoothing = min(max(count, 0), 1000)
        text = "%d" if choices.max_influences else "all"
        limits = (0, _MOST_INFLUENCES)
        most = count_slider(state, "Max. influences", choices.max_influences, limits, text)
        explain("number of influences to keep per vertex, largest first; 0 keeps all", why)
        choices.max_influences = max(most, 0)
    why = _unused(state, "correctives")
    with disabled(state, why):
        text = "transfer the template's pose correctives, if any"
        draw_setting(state, "Pose correctives", choices, "correctives", text, why)
    imgui.tree_pop()


def _unused(state: AppState, option: str) -> str:
    """Return the reason why the chosen method does not use an option."""
    method = method_now(state)
    if method in _ONLY.get(option, ("robust",)):
        return ""
    return f'the method "{method}" has no such option'


def _draw_shape(state: AppState) -> None:
    """Draw the settings of a skeleton that is found in the target's shape."""
    choices = state.of(Rigging).choices
    draw_setting(state, "Up##shape", choices, "up", "up axis of the target")
    text = "front of the target, from which left and right and the order of limbs follow"
    draw_setting(state, "Facing##shape", choices, "facing", text)
    text = "axis along which limbs mirror each other"
    draw_setting(state, "Symmetry", choices, "symmetry", text)
    text = "distance of joints in limbs without sharp bends, relative to the usual distance"
    draw_setting(state, "Joint spacing", choices, "joint_spacing", text)


def _draw_alignment(state: AppState) -> None:
    """Draw the settings of the alignment, its error, and the tools to move the template by hand."""
    rigging, why = state.of(Rigging), no_job_room(state)
    choices = rigging.choices
    draw_setting(state, "Up", choices, "up", "up axis of the target")
    draw_setting(state, "Facing", choices, "facing", "forward axis of the target")
    draw_setting(state, "Scale", choices, "scale")
    text = "rotate the template's joints and resize its limbs where the target differs"
    draw_setting(state, "Fit pose and proportions", choices, "fits", text)
    if button(state, "Align", why):
        start_align(state)
    explain(f"find the best placement by closest points{_FITS if choices.fits else ''}")
    same_line_if_room("Refine")
    refuses = why or ("" if placing_now(state) else "align the template first")
    if button(state, "Refine", refuses):
        _refine(state)
    explain(f"from its current placement, by closest points{_POSES if choices.fits else ''}")
    placing = placing_now(state)
    if placing is None:
        imgui.text_disabled("not aligned yet")
    else:
        _draw_error(placing.alignment)
    rigging.ghost = choice(state, "Template shown", rigging.ghost, GHOSTS)
    imgui.text_disabled("By hand")
    for number, (tool, (name, text)) in enumerate(TOOLS.items()):
        if number:
            same_line_if_room(name)
        label = f"{name}###rig tool {tool}"
        if radio(state, label, rigging.tool == tool, f"rig tool {tool}", text):
            choose_rig_tool(state, tool)
    template = aligned_template(state)
    if template is not None and rigging.tool not in ("", "landmarks"):
        _draw_numbers(state, template)
    if template is not None and (rigging.tool == "landmarks" or rigging.landmarks):
        _draw_landmarks(state, template)
    placing = placing_now(state)
    # Lines that appear and disappear are placed below the controls, which must not move.
    for line in placing.lines if placing is not None else ():
        imgui.text_wrapped(line.labelled)
    if is_posed_since(state):
        imgui.text_wrapped("the template was posed after the alignment: align it again")


def _draw_error(found: Alignment | None) -> None:
    """Draw the error, a trimmed RMS as in the report."""
    if found is None:
        imgui.text_disabled("error: not measured at this placement")
        return
    # With fitted limbs, there is only one scale.
    scales = found.similarity.factors, found.similarity.own_factors
    is_even = all((factors == 1.0).all() for factors in scales)
    how = _METHODS[found.how] if found.how != "fit" or is_even else _STRETCHED
    text = f"error {100.0 * found.error:.2f} % ({how})"
    if found.error > _DOUBTFUL:
        warning(f"{text}: doubtful")
    else:
        imgui.text_wrapped(text)
    explain(
        "RMS distance of the best 90 % of the target from the template, relative to the target's "
        f"size; distance of the template from the target: {100.0 * found.away:.2f} %"
    )


def _refine(state: AppState) -> None:
    """Refine the current alignment by closest points; box corners as landmarks represent it."""
    rigging = state.of(Rigging)
    template = aligned_template(state)
    if template is None:
        return
    low, high = (f(posed_template(rigging, template).positions, axis=0) for f in (np.min, np.max))
    corners = np.array([low, *(np.where(np.eye(3)[axis] > 0, high, low) for axis in range(3))])
    corners[1:] += (high == low) * np.eye(3)  # keeps the four corners of flat meshes distinct
    pairs = np.stack([corners, similarity_now(state, template).apply(corners)], axis=1)
    scale = rigging.choices.scale
    start_align(state, AlignmentSettings(landmarks=pairs, scale=scale, keeps_landmarks=False))


def _draw_numbers(state: AppState, template: Template) -> None:
    """Draw input fields of the template's placement: translation, Euler angles, scale."""
    now = similarity_now(state, template)
    angles = np.degrees(matrix_to_euler(now.rotation[None])[0])
    shift = _vector_field(state, "Translation", now.shift, "%.4g")
    angle = _vector_field(state, "Rotation", angles, "%.2f\N{DEGREE SIGN}")
    typed = number_field(state, begin_field("Scale factor"), now.scale)
    note_item(state, "Scale factor")
    scale = typed if typed is not None and typed > 0.0 else None
    if shift is None and angle is None and scale is None:
        if button(state, "Align boxes"):
            fit = box_fit(posed_template(state.of(Rigging), template), target_mesh(state))
            _move(state, template, fit)
        return
    rotation = now.rotation
    if angle is not None:
        x, y, z = (axis_rotations(axis, np.radians(angle[axis])) for axis in range(3))
        rotation = z @ y @ x
    moved = replace(
        now,
        scale=now.scale if scale is None else scale,
        rotation=rotation,
        shift=now.shift if shift is None else shift,
    )
    _move(state, template, moved)


def _vector_field(state: AppState, label: str, values: Floats, text: str) -> Floats | None:
    """Draw three number fields; return the vector with the number that was entered, if any."""
    entered = values.copy()
    found = []

    def draw(hidden: str, axis: int) -> None:
        number = number_field(state, hidden, plain_zero(float(values[axis]), text), text)
        if number is not None:
            entered[axis] = number
            found.append(axis)

    in_row(begin_field(label), range(3), draw)
    note_item(state, label)
    return entered if found else None


def _move(state: AppState, template: Template, similarity: Similarity) -> None:
    move_by_hand(state, template, similarity)
    state.of(Rigging).was_dragged = True


def _draw_landmarks(state: AppState, template: Template) -> None:
    """Draw the list of landmarks, and the button to align by them."""
    view = state.of(Rigging)
    if view.tool == "landmarks":
        side = "the same point of the target" if view.pending else "a point of the blue template"
        imgui.text_wrapped(f"Click {side}.")
    removed = -1
    for row in range(len(view.landmarks)):
        if imgui.small_button(f"x##landmark {row}"):
            removed = row
        note_item(state, f"delete landmark {row}")
        explain("delete this pair")
        imgui.same_line()
        imgui.text_unformatted(f"Pair {row + 1}")
        if row % 3 != 2 and row + 1 < len(view.landmarks):
            imgui.same_line()
    if removed >= 0:
        del view.landmarks[removed]
    draw_setting(state, "Refine by closest points", view.choices, "refines")
    missing = _FEWEST - len(view.landmarks)
    why = f"{missing} more pair{'s' * (missing != 1)} needed" if missing > 0 else ""
    if button(state, "Align by landmarks", why or no_job_room(state)):
        mesh = posed_template(view, template)
        try:
            start_align(state, landmark_settings(state, mesh, view.choices.refines))
        except ViewerError as problem:
            state.error = str(problem)
    with disabled(state, "" if view.landmarks else "there are no landmarks"):
        same_line_if_room("Delete all")
        if button(state, "Delete all"):
            view.landmarks, view.pending = [], None
