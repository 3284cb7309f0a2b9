"""Export for other programs: the list of formats, the actors and files, and writing of motions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path

from imgui_bundle import imgui

from viewer.app.core.jobs import ThreadJob
from viewer.app.core.reasons import no_job_room
from viewer.app.core.saved_work import (
    Animations,
    SavedPose,
    SavedWork,
    edited_aside,
    with_edited_keys,
)
from viewer.app.core.state import AppState, shows_errors
from viewer.app.core.text_fields import text_field
from viewer.app.core.widgets import checkbox, choice, disabled, explain, note_item
from viewer.app.files.file_choice import FileDialog
from viewer.app.files.files import ask_where_to_write
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note, wording
from viewer.errors import RigError
from viewer.exporters import (
    EXPORTERS,
    FOLDER,
    Exporter,
    ExportOptions,
    Part,
    Selection,
    export,
    exporters_at,
    sampled,
    suited_exporter,
    usable_exporters,
)
from viewer.exporters._motion_paths import files_at, is_together, motion_paths, part_paths
from viewer.exporters._options import SAFE_NAMES, PageOptions
from viewer.exporters.vrm.humanoid import is_humanoid
from viewer.formats import all_or_none, check_folder_target, check_targets, file_stem
from viewer.phrases import Remedy, agree, all_of, counted, printable
from viewer.progress import part_of_work, report
from viewer.rigs.bodies.smpl_family import member_of
from viewer.rigs.motion.animation_choice import has_own_animations, keeps_keys, own_animations
from viewer.rigs.motion.timing import frame_at
from viewer.rigs.pose import pose_key
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.springs.simulation import release_springs

N_ROWS = 6.5
"""Height of the list in lines: half a line shows that the list continues."""
_COLUMNS = (("Format", 0.3), ("Keeps", 0.4), ("Omits", 0.3))


@dataclass(slots=True)
class Chosen:
    """Whether to export all actors or only the selected one, and how."""

    everyone: bool = False
    options: ExportOptions = field(default_factory=ExportOptions)


@dataclass(frozen=True, slots=True, eq=False)
class _Motion:
    """One actor to export: its state at the start of the export, target file and frames."""

    actor: Actor
    path: Path
    frames: tuple[int, int] | None
    rate: float | None
    saved: tuple[object, ...]


def ask_for_motion(state: AppState, suffix: str = "") -> None:
    """Open the dialog; ``suffix``: that of the suggested file, the first format's if empty."""
    moving = _moving_actors(state)
    asks = len(moving) > 1 or state.actor not in moving
    selection = Chosen(asks)
    first = _first(state, selection)
    # The number of each person is appended to the name if there are several files.
    stem = file_stem(first.title if len(moving) > 1 else first.name)
    suffixes = motion_suffixes()
    ask_where_to_write(
        state,
        lambda state, path: save_motion(state, path, selection.everyone, selection.options),
        "Export motion",
        suffixes,
        f"{stem}_edited{suffix}" if suffix else f"{stem}{suffixes[0]}",
        more=lambda state, dialog: _draw_more(state, dialog, selection),
        more_rows=N_ROWS + (3.0 if asks else 1.5),
        written=lambda path: motion_files(state, path, selection.everyone),
    )


def _first(state: AppState, selection: Chosen) -> Actor:
    """Return the first actor whose motion is exported."""
    return _moving_actors(state)[0] if selection.everyone else state.actor


def _draw_more(state: AppState, dialog: FileDialog, selection: Chosen) -> None:
    """Draw the choice of actors and format."""
    moving = _moving_actors(state)
    if len(moving) > 1 or state.actor not in moving:
        _draw_actors(state, selection, len(moving), state.actor in moving)
        is_one = dialog.suffix == "" or is_one_file(Path(f"motion{dialog.suffix}"))
        explain("one file for all" if is_one else "one file per actor, numbered by actor")
    actor = _first(state, selection)
    _draw_formats(state, dialog, motion_formats(actor), unsuited_formats(actor))
    suffix = Path(dialog.typed_name()).suffix.lower() or dialog.suffix
    known = {name for kind in exporters_at(f"motion{suffix}") for name in kind.options}
    options = selection.options
    if "page" in known:
        count = len(state.scene.actors) if selection.everyone else 1
        options.page = draw_page(state, options.page, count)
        return
    why = "" if "safe_names" in known else "for .bvh only"
    options.safe_names = checkbox(state, "Safe names", options.safe_names, why)
    explain(SAFE_NAMES, why)


def _draw_actors(state: AppState, selection: Chosen, count: int, has_own: bool = True) -> None:
    """Draw the choice between all actors, so many, and the selected one."""
    whose = {"all": f"all {count} actors"}
    if has_own:
        whose["one"] = f"only {printable(state.actor.name, 60)}"
    now = "all" if selection.everyone else "one"
    selection.everyone = choice(state, "Actors##exported", now, whose, 12.0) == "all"


def options_for(state: AppState, path: Path, options: ExportOptions | None) -> ExportOptions:
    """Return the options that apply to a file, of those that were chosen in its dialog."""
    found = replace(options or ExportOptions(), skinning=replace(state.options.skinning))
    if not any("page" in kind.options for kind in exporters_at(path)):
        found.page = PageOptions()  # another format was chosen before
    return found


def draw_page(state: AppState, page: PageOptions, n_actors: int) -> PageOptions:
    """Draw the options of a page with some actors on one line, and return them."""
    facts = PageOptions.__dataclass_fields__
    why = "" if n_actors > 1 else "for two figures or more"
    wipes = checkbox(state, "Divider", page.wipes and not why, why)
    explain(facts["wipes"].metadata["help"], why)
    imgui.same_line()
    imgui.set_next_item_width(-1.0)
    caption = text_field("##caption", page.caption, "caption")[1]
    note_item(state, "Caption")
    explain(facts["caption"].metadata["help"])
    return PageOptions(caption, wipes)


def _moving_actors(state: AppState) -> list[Actor]:
    """Return the actors whose joints are moved by a motion."""
    return [actor for actor in state.scene.actors if actor.joint_motion]


def motion_suffixes() -> tuple[str, ...]:
    """Return the suffixes of files that contain one actor's motion; the default is first."""
    kinds = [kind for kind in usable_exporters() if kind.stores_motion and not kind.is_numbered]
    found = dict.fromkeys(suffix for kind in kinds if not kind.folder for suffix in kind.suffixes)
    return (".bvh", *(suffix for suffix in found if suffix != ".bvh"))


def motion_formats(actor: Actor) -> dict[str, Exporter]:
    """Return exporters of motions by suffix: if there are several, the one that suits the actor."""
    found = {
        suffix: EXPORTERS[suited_exporter(f"motion{suffix}", actor.figure)]
        for suffix in motion_suffixes()
    }
    return {**found, FOLDER: EXPORTERS[suited_exporter("motion", actor.figure)]}


def unsuited_formats(actor: Actor) -> dict[str, str]:
    """Return the reasons why formats cannot store the motion of an actor, by suffix."""
    skeleton, whys = actor.figure.skeleton, dict[str, str]()
    if skeleton is None or member_of(tuple(skeleton.parents.tolist())) is None:
        whys["smpl"] = "for bodies of the SMPL family only"
    if skeleton is not None and not is_humanoid(actor.figure):
        whys["human"] = "for humanoids only: some human bones were not found"
    formats = motion_formats(actor)
    return {suffix: whys[kind.joints] for suffix, kind in formats.items() if kind.joints in whys}


def motion_files(state: AppState, path: Path, everyone: bool) -> list[Path]:
    """Return all files that are written for a name, or the folder of frames (no suffix)."""
    actors = _moving_actors(state) if everyone else [state.actor]
    kinds = [kind for kind in exporters_at(path) if kind.stores_motion]
    if not kinds or not actors:
        return [path]
    paths = part_paths(kinds[0], path, actors, ExportOptions())
    return [*dict.fromkeys(file for each in paths for file in files_at(kinds[0], each))]


def is_one_file(path: Path) -> bool:
    """Return whether a name selects one file, or folder, with all actors."""
    kinds = [kind for kind in exporters_at(path) if kind.stores_motion]
    return any(is_together(kind, path, ExportOptions()) for kind in kinds)


def figures(scene: Scene) -> list[Actor]:
    """Return the actors whose poses are exported together: captured points only if alone."""
    return [actor for actor in scene.actors if not actor.moves_points] or [*scene.actors]


def scene_now(state: AppState) -> Scene:
    """Return a copy of the scene, which later edits do not change."""
    return replace(state.scene, actors=[actor.copy() for actor in state.scene.actors])


@shows_errors
def save_motion(
    state: AppState, path: Path, everyone: bool = False, options: ExportOptions | None = None
) -> None:
    """Write all or none of the motions within the playback range, in the background.

    glTF gets all animations of a figure with their own keys, unless the range is a part of one.
    Folders, and formats that hold several figures, contain ``everyone``, including those that do
    not move; other formats get one file per actor. A path without suffix is an EasyMocap folder.
    """
    if why := no_job_room(state):
        state.error = why
        return
    motions, selected, left_out = _motions(state, path, everyone)
    kind = suited_exporter(path, motions[0].actor.figure)
    files = motion_files(state, path, everyone)
    # The dialog has already asked whether to replace existing files.
    if path.suffix:
        check_targets(files, state.inputs, force=True)
    else:
        check_folder_target(files[0], state.inputs, force=True)
    scene = scene_now(state)
    options = replace(options_for(state, path, options), kind=kind)
    has_still = everyone and "pose" in EXPORTERS[kind].stores and is_one_file(path)
    still = [each for each in state.scene.actors if has_still and each.clip is None]
    known, written = state.of(SavedWork), [one for each in motions for one in each.saved]
    written += [
        SavedPose(each, pose_key(each.own_pose)) for each in still if each.own_pose is not None
    ]
    still = [each.copy() for each in still]
    n_paths = len({each.path for each in motions})
    more = f" and {n_paths - 1} more" if path.suffix and n_paths > 1 else ""
    title = f"Writing {printable(motions[0].path.name, 60)}{more}"

    def write() -> list[str]:
        with part_of_work(title), all_or_none(files if path.suffix else []):
            parts = _parts(scene, motions, still, path, options)
            notes = export(Selection(parts, scene, selected), path, options=options)
            if path.suffix:
                report(1, 1)  # as in save_in_background
            return [*map(str, [*notes, *left_out])]

    state.job = ThreadJob(title, write, lambda: known.add(*written), "export")


def _motions(
    state: AppState, path: Path, everyone: bool
) -> tuple[list[_Motion], list[Actor], list[Diagnostic]]:
    """Return the motions to write, all actors that count in names, and notes about omitted ones."""
    actors = _moving_actors(state) if everyone else [state.actor]
    paths = [path] * len(actors) if is_one_file(path) else motion_paths(path, actors)
    motions, selected, notes = list[_Motion](), [*actors], list[Diagnostic]()
    for index, (actor, file) in enumerate(zip(actors, paths, strict=True)):
        frames = _range(state, actor)
        if frames is not None and frames[0] >= frames[1]:
            notes.append(
                note(
                    "X003.absent-in-range: {figure}: absent throughout the range, not exported",
                    figure=actor.name,
                )
            )
            continue
        # Edits made during the export must not change the written motion.
        copied = selected[index] = actor.copy()
        copied.figure = with_edited_keys(state.of(Animations), actor)
        if actor.springs is not None and actor.joint_motion:
            copied.springs = None
            release_springs(copied)
            springs = actor.figure.require_skeleton().springs
            count = 0 if springs is None else springs.n_joints
            values = {
                "figure": actor.name,
                "n": counted(count, "spring joint"),
                "have": agree(count, "has", "have"),
                "remedy": Remedy("can write", "--bake-springs writes"),
            }
            notes.append(note(wording.SPRINGS, **values))
        is_keyed = actor.keyed is not None
        rate = state.clock.frame_rate if is_keyed else None
        saved = () if frames is not None else _written_keys(state, actor, file)
        motions.append(_Motion(copied, file, frames, rate, saved))
    if not motions:
        raise RigError("all actors are absent in the playback range: nothing to export")
    return motions, selected, notes + (points_note(state.scene) if everyone else [])


def points_note(scene: Scene) -> list[Diagnostic]:
    """Return a note about captured points, which are not among all exported actors."""
    exported = figures(scene)
    names = [actor.name for actor in scene.actors if actor not in exported]
    if not names:
        return []
    return [note("X003.points: captured points are not exported: {names}", names=all_of(names))]


def _written_keys(state: AppState, actor: Actor, file: Path) -> tuple[object, ...]:
    """Return the edited clips of an actor that a file contains, and the pose under its clip."""
    stores_all = any("clips" in kind.stores for kind in exporters_at(file))
    has_all = stores_all and keeps_keys(state.scene, actor)
    clips = (actor.clip, *(edited_aside(state.of(Animations), actor).values() if has_all else ()))
    if actor.own_pose is None:
        return clips
    # A pose made by hand at this time is not part of the motion.
    return (*clips, SavedPose(actor, pose_key(state.clock.posed(actor, actor.own_pose))))


def _parts(
    scene: Scene,
    motions: Sequence[_Motion],
    still: Sequence[Actor],
    path: Path,
    options: ExportOptions,
) -> list[Part]:
    """Return what is written: keys if the format holds them, otherwise frames."""
    kind = EXPORTERS[options.kind]
    # In one file, all actors have keys, or all have frames, as if one of them begins later than
    # another: animations are shared and have no delay.
    keyed = [
        "clips" in kind.stores and each.frames is None and keeps_keys(scene, each.actor)
        for each in motions
    ]
    if is_together(kind, path, options):
        has_delays = len({each.actor.offset for each in motions}) > 1
        keyed = [all(keyed) and not has_delays] * len(motions)
    parts = [
        Part(each.actor, own_animations(each.actor) or None)
        if is_keyed
        else sampled(options.kind, options, scene, each.actor, each.rate, each.frames)
        for each, is_keyed in zip(motions, keyed, strict=True)
    ]
    for actor in still:
        has_keys = all(keyed) and has_own_animations(actor)
        parts.append(Part(actor, own_animations(actor) or None if has_keys else None))
    return parts


def _range(state: AppState, actor: Actor) -> tuple[int, int] | None:
    """Return the frames of the actor's clip within the playback range; None for all."""
    clock, clip = state.clock, actor.clip
    if (clock.start, clock.end) == clock.whole or clip is None:
        return None
    rate = clock.frame_rate if clip.timing is None else clip.frame_rate
    count = frame_at(clip.end - clip.start, rate) + 1
    first = -frame_at(clip.start + actor.offset - clock.start, rate)
    stop = frame_at(clock.end - actor.offset - clip.start, rate) + 1
    return max(first, 0), min(stop, count)


def pose_formats() -> dict[str, Exporter]:
    """Return the exporters of poses by suffix; none of them keeps a motion then."""
    kinds = [_of_pose(kind) for kind in usable_exporters() if "pose" in kind.stores]
    return {suffix: kind for kind in kinds for suffix in kind.suffixes}


def _of_pose(kind: Exporter) -> Exporter:
    """Return an exporter with the data that it keeps and omits when it writes a single pose."""
    kept = kind.keeps.split(", ")
    if "motion" not in kept:
        return kind
    kept.remove("motion")
    title = kind.title.partition(":")[0]
    return replace(kind, title=title, keeps=", ".join(kept), omits=f"motion, {kind.omits}")


def draw_pose_formats(state: AppState, dialog: FileDialog, selection: Chosen) -> None:
    """Draw the list of formats of poses, and the options of the chosen one."""
    record = state.actor.figure.record
    is_vrm = record is not None and record.vrm is not None
    why = "other figures need an author and a licence, which viewer convert takes"
    formats = pose_formats()
    missing = [suffix for suffix, kind in formats.items() if "meta" in kind.options and not is_vrm]
    _draw_formats(state, dialog, formats, dict.fromkeys(missing, why))
    suffix = Path(dialog.typed_name()).suffix.lower() or dialog.suffix
    if suffix not in formats:
        return
    count = len(figures(state.scene))
    if count > 1 and is_one_file(Path(f"pose{suffix}")):
        _draw_actors(state, selection, count)
        explain("in their current poses, one file for all")
    if "page" in formats[suffix].options:
        shown = count if selection.everyone else 1
        selection.options.page = draw_page(state, selection.options.page, shown)


def _draw_formats(
    state: AppState,
    dialog: FileDialog,
    formats: Mapping[str, Exporter],
    missing: Mapping[str, str],
) -> None:
    """Draw a list of formats by suffix or ``FOLDER``; a choice changes the suffix of the name."""
    typed = Path(dialog.typed_name()).suffix.lower()
    now = typed if typed in formats else dialog.suffix or FOLDER
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.scroll_y | imgui.TableFlags_.borders_outer
    height = N_ROWS * imgui.get_text_line_height_with_spacing()
    if not imgui.begin_table("##formats", len(_COLUMNS), flags, (0.0, height)):
        return
    imgui.table_setup_scroll_freeze(0, 1)
    for title, part in _COLUMNS:
        imgui.table_setup_column(title, imgui.TableColumnFlags_.width_stretch, part)
    imgui.table_headers_row()
    for suffix, kind in formats.items():
        why = missing.get(suffix, "")
        if _draw_row(state, suffix, kind, suffix == now, why) and not why:
            old = typed if typed in formats else ""
            name = dialog.typed_name()
            dialog.suffix = "" if suffix == FOLDER else suffix
            dialog.name = name[: len(name) - len(old)] + dialog.suffix
    imgui.end_table()
    note_item(state, "formats")


def _draw_row(state: AppState, suffix: str, kind: Exporter, is_chosen: bool, why: str) -> bool:
    """Draw the row of a format; return whether it was chosen."""
    imgui.table_next_row()
    imgui.table_next_column()
    flags = imgui.SelectableFlags_.span_all_columns | imgui.SelectableFlags_.no_auto_close_popups
    shown = "folder" if suffix == FOLDER else suffix
    name = kind.title.partition(":")[0]
    with disabled(state, why):
        pressed = imgui.selectable(f"{shown}  {name}###format {suffix}", is_chosen, flags)[0]
        note_item(state, f"format {suffix}")
        explain(f"{kind.title}\nkeeps: {kind.keeps}\nomits: {kind.omits}", why)
        if is_chosen and imgui.is_window_appearing():
            imgui.set_scroll_here_y(0.5)
        for text in (kind.keeps, kind.omits):
            imgui.table_next_column()
            imgui.text_unformatted(text)
    return pressed
