"""Exporters of posed figures and motions for other programs, one module each."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from pathlib import Path

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, frame_range, note
from viewer.errors import PluginError, RigError, UnsupportedFormatError
from viewer.exporters._exporter import FOLDER, Content, Exporter, Part, SampledParts, Selection
from viewer.exporters._left_out import motion_notes
from viewer.exporters._motion_paths import files_at, is_together, part_files, part_paths
from viewer.exporters._options import ExportOptions, PageOptions, VrmMeta
from viewer.formats import FORMATS, all_or_none
from viewer.interrupts import raising
from viewer.media.image import PICTURES
from viewer.media.video_kinds import VIDEOS
from viewer.phrases import all_of, counted, listed, printable
from viewer.plugins import plugin_of, plugins_of
from viewer.rigs.bodies.smpl_family import member_of
from viewer.rigs.captures.cameras import CameraView
from viewer.rigs.captures.person import is_tracked, person_label
from viewer.rigs.figure import Figure
from viewer.rigs.motion.sampled_animation import sample_upright_points, upright_animation
from viewer.rigs.motion.upright import upright_actor, upright_placement
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skinning import Skinning

__all__ = [
    "EXPORTERS",
    "FOLDER",
    "ExportOptions",
    "Exporter",
    "PageOptions",
    "Part",
    "SampledParts",
    "Selection",
    "VrmMeta",
    "check_figure",
    "export",
    "exporter_for",
    "exporters_at",
    "exporters_of",
    "files_written",
    "output_files",
    "sampled",
    "suited_exporter",
    "usable_exporters",
]


_POSE = frozenset[Content]({"pose"})
_MOTION = frozenset[Content]({"frames"})
_BOTH = _POSE | _MOTION

EXPORTERS = {
    "obj": Exporter(
        "Wavefront OBJ: the posed mesh",
        (".obj",),
        "the posed mesh, textures",
        "joints, weights",
        _BOTH,
        needs="mesh",
        is_numbered=True,
        keeps_gaps=True,
    ),
    "ply": Exporter(
        "PLY: the posed mesh",
        (".ply",),
        "the posed mesh, texture coordinates",
        "joints, weights, textures",
        _POSE,
        needs="mesh",
    ),
    "npz": Exporter(
        "NumPy arrays: posed vertices and joints",
        (".npz",),
        "posed vertices and joints as arrays",
        "weights, materials",
        _BOTH | {"points"},
        keeps_gaps=True,
    ),
    "pose": Exporter(
        "pose: joints by name and the pose vector",
        (".json", ".txt"),
        "rotations of joints, shape",
        "mesh, weights",
        _POSE,
        needs="skeleton",
    ),
    "rig": Exporter(
        "course rig: .skel and .skin",
        (".skel", ".skin"),
        "mesh, joints, limits, weights, texture",
        "blend shapes, pose correctives",
        _POSE,
        needs="skeleton",
        written=dict.fromkeys((".skel", ".skin"), (".skel", ".skin")),
    ),
    "anim": Exporter(
        "clip: keys of a course rig",
        (".anim",),
        "keys of the clip, or one per frame",
        "mesh, shape, scale",
        _MOTION,
        needs="skeleton",
        joints="course",
    ),
    "gltf": Exporter(
        "glTF: mesh, skin and motion",
        (".glb", ".gltf"),
        "mesh, weights, materials, shapes, motion",
        "joint limits, pose correctives",
        _BOTH | {"clips"},
        stores_many=True,
        stores_cameras=True,
        options=frozenset({"optimizes"}),
        written={".gltf": ("", ".bin")},
    ),
    "vrm": Exporter(
        "VRM: humanoid character",
        (".vrm",),
        "mesh, weights, materials, shapes, human bones, expressions, springs, meta data",
        "pose, motion, joint limits, pose correctives",
        _POSE,
        needs="skeleton",
        joints="human",
        options=frozenset({"optimizes", "meta"}),
    ),
    "vrma": Exporter(
        "VRM animation: motion of a humanoid",
        (".vrma",),
        "motion of human bones, expressions",
        "mesh, other joints",
        _MOTION,
        needs="skeleton",
        joints="human",
    ),
    "bvh": Exporter(
        "BVH: skeleton and motion",
        (".bvh",),
        "joints and their motion",
        "mesh, weights, changes of shape",
        _MOTION | {"parts"},
        needs="skeleton",
        options=frozenset({"safe_names"}),
    ),
    "amass": Exporter(
        "AMASS: parameters of the SMPL family",
        (".npz",),
        "pose, position and shape of an SMPL body",
        "scale",
        _MOTION,
        joints="smpl",
        keeps_world=True,
    ),
    "smplx": Exporter(
        "SMPL-X for robots (GMR, PHC)",
        (".npz",),
        "pose, position and mean shape of an SMPL body, z up",
        "scale, hands of SMPL",
        _MOTION,
        joints="smpl",
    ),
    "html": Exporter(
        "HTML page: figures and motion in any browser",
        (".html",),
        "mesh, weights, materials, shapes, pose correctives, motion",
        "joint limits",
        _BOTH,
        stores_many=True,
        keeps_gaps=True,
        omits_hidden=True,
        options=frozenset({"page"}),
    ),
    "easymocap": Exporter(
        "EasyMocap: a folder of frames",
        (FOLDER,),
        "pose, position and shape of SMPL bodies",
        "scale",
        _MOTION,
        stores_many=True,
        joints="smpl",
        folder="smpl",
        keeps_gaps=True,
        keeps_world=True,
    ),
}
"""Modules in this folder; ``Exporter`` describes what they have. Rows of plug-ins are added, with
their suffix as the key, when a file with that suffix is to be written."""
_OWN = frozenset(EXPORTERS)


def usable_exporters() -> list[Exporter]:
    """Return all exporters for menus; ``viewer doctor`` says which plug-ins cannot be used."""
    for plugin in plugins_of("exporters"):
        with suppress(PluginError):
            _find_plugin(f".{plugin.name}")
    return [*EXPORTERS.values()]


def _find_plugin(suffix: str) -> None:
    """Add the row of a plug-in to ``EXPORTERS`` if none of this program writes a suffix."""
    if any(suffix in EXPORTERS[key].suffixes for key in _OWN):
        return
    plugin = plugin_of("exporters", suffix[1:])
    if plugin is None:
        EXPORTERS.pop(suffix, None)  # plug-ins have been switched off since
        return
    row = plugin.load().EXPORTER
    if not isinstance(row, Exporter) or row.suffixes != (suffix,) or row.joints or row.folder:
        wanted = f'expected EXPORTER to be an Exporter of ("{suffix}",), of any joints, of files'
        raise plugin.error(f"{wanted}, found {row!r:.80}")
    EXPORTERS[suffix] = row


def _write(key: str, selection: Selection, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write files with an exporter, and return its notes."""
    if key in _OWN:
        module = import_module(f"{__name__}.{key}")
        return list[Diagnostic](module.export(selection, path, options))
    plugin = plugin_of("exporters", key[1:])
    assert plugin is not None  # as its row is in ``EXPORTERS``
    if path.is_file():
        path.resolve().unlink()  # ``all_or_none`` restores it unless the plug-in writes another
    with plugin.guarded(f"cannot write {printable(path, 300)}"):
        notes = [*plugin.load().export(selection, path, options)]
    if not all(isinstance(each, Diagnostic) for each in notes) or not path.is_file():
        raise plugin.error(f"expected export to write {printable(path, 300)} and to return notes")
    return notes


def exporters_at(path: str | Path) -> list[Exporter]:
    """Return the exporters that write files of this suffix, or folders if there is none."""
    suffix = Path(path).suffix.lower() or FOLDER
    _find_plugin(suffix)
    return [kind for kind in EXPORTERS.values() if suffix in kind.suffixes]


def exporters_of(path: str | Path, content: Content) -> list[str]:
    """Return the keys in ``EXPORTERS`` that write this content to such files, or raise."""
    suffix = Path(path).suffix.lower()
    _find_plugin(suffix or FOLDER)
    kinds = {key: kind for key, kind in EXPORTERS.items() if content in kind.stores}
    found = [key for key, kind in kinds.items() if (suffix or FOLDER) in kind.suffixes]
    if found:
        return found
    if content == "points":
        raise RigError(
            "there are only keypoints: a motion of joints cannot be written (.npz stores points)"
        )
    if not exporters_at(path):
        raise no_exporter(path)
    what = "no motion exporter" if content == "frames" else "no exporter of poses"
    known = known_suffixes(kinds.values())
    raise UnsupportedFormatError(f'{what} for "{suffix or FOLDER}"; supported: {known}')


def no_exporter(path: str | Path) -> UnsupportedFormatError:
    """Return the error of a suffix that nothing writes."""
    known = ", ".join([known_suffixes(), *(f".{each.name}" for each in plugins_of("exporters"))])
    suffix = Path(path).suffix.lower() or FOLDER
    if suffix in (*PICTURES, *VIDEOS):
        known += "; viewer render draws pictures and videos, as do viewer.render and viewer.video"
    read = any(suffix in each.suffixes for each in FORMATS.values())
    only = ", which is only read; .glb holds figures and motions" if read else ""
    return UnsupportedFormatError(f'no exporter for "{suffix}"{only}; supported: {known}')


def known_suffixes(kinds: Iterable[Exporter] = EXPORTERS.values()) -> str:
    """Return the suffixes of the built-in exporters, or of some, as text."""
    suffixes = dict.fromkeys(each for kind in kinds for each in kind.suffixes)
    return ", ".join("a folder for EasyMocap" if each == FOLDER else each for each in suffixes)


def exporter_for(path: str | Path) -> str:
    """Return the key in ``EXPORTERS`` that writes poses to files of this suffix, or raise."""
    return exporters_of(path, "pose")[0]


def suited_exporter(path: str | Path, figure: Figure) -> str:
    """Return the exporter of a figure's motion; AMASS for arrays of bodies of the SMPL family."""
    found = exporters_of(path, "frames")
    skeleton = figure.skeleton
    is_member = skeleton is not None and member_of(tuple(skeleton.parents.tolist())) is not None
    suited = [key for key in found if (EXPORTERS[key].joints == "smpl") == is_member]
    return (suited or found)[0]


def export(
    selection: Actor | Selection,
    path: str | Path,
    skinning: Skinning | None = None,
    optimizes: bool = False,
    meta: VrmMeta | None = None,
    options: ExportOptions | None = None,
) -> list[Diagnostic]:
    """Write an actor in its current pose, or a selection; return notes as ``viewer.export`` does.

    Either all files are written or none. A selection has several actors, with their poses, their
    own keys, or frames, and the scene in which they are placed.
    """
    chosen = replace(options) if options is not None else ExportOptions()
    chosen.skinning = chosen.skinning if skinning is None else skinning
    chosen.meta, chosen.optimizes = meta or chosen.meta, optimizes or chosen.optimizes
    plan = _plan(selection, Path(path), chosen)
    notes = list[Diagnostic]()
    # A folder is written to a temporary one, which is renamed at the end.
    with all_or_none([] if plan.kind.folder else plan.files(chosen)):
        for each, file in plan.groups:
            part = each.parts[0]
            with raising():  # sampling and comparing may take long; saving holds signals itself
                notes += _write(plan.key, each, file, replace(chosen, world_up=part.up))
            if part.frames is None or plan.kind.omits_hidden:
                notes += _hidden_note(each.actors, plan.kind)
            if part.content == "frames" and not plan.kind.stores_many:
                notes += motion_notes(part.animation)
    return notes + _untracked_note(plan) + plan.omitted


def output_files(selection: Actor | Selection, path: Path, options: ExportOptions) -> list[Path]:
    """Return all files, or the folder, that ``export`` writes."""
    return _plan(selection, path, options).files(options)


def files_written(path: str | Path) -> list[Path]:
    """Return all files that an export of a pose writes, such as two for a rig or a ``.gltf``."""
    return files_at(EXPORTERS[exporter_for(path)], Path(path))


def check_figure(key: str, figure: Figure) -> None:
    """Raise RigError if an exporter cannot write a figure's joints, names or unit."""
    if EXPORTERS[key].joints:
        import_module(f"{__name__}.{key}").require(figure)


def sampled(
    key: str,
    options: ExportOptions,
    scene: Scene,
    actor: Actor,
    rate: float | None = None,
    frames: tuple[int, int | None] | None = None,
    interpolate: bool = False,
) -> Part:
    """Sample an actor's motion; captures keep their own world unless an up axis is requested."""
    check_figure(key, actor.figure)
    if actor.moves_points:
        return Part(actor, None, *sample_upright_points(scene, actor, rate, frames, interpolate))
    keeps_world = EXPORTERS[key].keeps_world and not options.up
    found = upright_animation(scene, actor, rate, frames, interpolate, keeps_world)
    return Part(actor, None, *found)


@dataclass(frozen=True, slots=True, eq=False)
class _Plan:
    """The files of an export."""

    key: str
    groups: list[tuple[Selection, Path]]
    """What is written to each file, or to each pattern of names."""
    omitted: list[Diagnostic]
    """Notes about actors that are not written."""

    @property
    def kind(self) -> Exporter:
        return EXPORTERS[self.key]

    def files(self, options: ExportOptions) -> list[Path]:
        """Return all files, or the folder, that are written."""
        found = [
            file
            for each, path in self.groups
            for file in part_files(self.kind, each.parts[0], path, options)
        ]
        return [*dict.fromkeys(found)]


def _plan(selection: Actor | Selection, path: Path, options: ExportOptions) -> _Plan:
    """Choose the exporter, the actors that it can write, and their files."""
    if isinstance(selection, Actor):
        # This actor was asked for, whether it is present or not.
        selection = Selection([Part(replace(selection, is_present=True))])
    if not selection.parts:
        raise RigError("expected at least one actor to write, found none")
    key = options.kind or _suited(selection.parts[0], path)
    kind, scene = EXPORTERS[key], selection.scene
    if options.optimizes and "optimizes" not in kind.options:
        raise UnsupportedFormatError(f"{path.suffix}: only glTF files can be optimised")
    if options.page != PageOptions() and "page" not in kind.options:
        raise UnsupportedFormatError(f"{path.suffix}: only pages have a caption and a divider")
    for part in selection.parts:
        if part.content not in kind.stores:
            raise UnsupportedFormatError(f"{path.name}: {key} files cannot store {part.content}")
    # If no figure has what the format needs, the exporter says so.
    able = [part for part in selection.parts if kind.holds(part.actor.figure)]
    able = able or [*selection.parts]
    for part in able:
        if part.frames is not None:
            check_figure(key, part.actor.figure)
    counted = selection.among or [part.actor for part in able]
    paths = dict(zip(map(id, counted), part_paths(kind, path, counted, options), strict=True))
    there = [part for part in able if part.present.any()]
    if not there:
        when = "at that time" if able[0].frames is None else f"in {_span(able[0])}"
        raise RigError(f"no person is present {when}: there is nothing to write")
    omitted = [_absent_note(part) for part in able if not part.present.any()]
    lacking = (
        "X003.no-mesh: {figure}: no mesh, not written"
        if kind.needs == "mesh"
        else "X003.no-skeleton: {figure}: no skeleton, not written"
    )
    omitted += [
        note(lacking, figure=part.actor.name) for part in selection.parts if part not in able
    ]
    # A file for each actor has no cameras.
    together = is_together(kind, path, options)
    if scene is not None and scene.views and not (together and kind.stores_cameras):
        omitted.append(_cameras_note(scene.views))
    if together:
        parts = [part if scene is None else _placed(scene, part) for part in there]
        return _Plan(key, [(Selection(parts, scene), path)], omitted)
    groups = []
    for part in there:
        actor = part.actor if scene is None else upright_actor(scene, part.actor)
        groups.append((Selection([replace(part, actor=actor)]), paths[id(part.actor)]))
    return _Plan(key, groups, omitted)


def _suited(part: Part, path: Path) -> str:
    """Return the exporter of a part's content that suits its figure."""
    if part.content == "frames":
        return suited_exporter(path, part.actor.figure)
    return exporters_of(path, part.content)[0]


def _placed(scene: Scene, part: Part) -> Part:
    """Return a part whose figure stands upright in its own space, and its placement."""
    placement = upright_placement(scene, part.actor)
    return replace(part, actor=replace(upright_actor(scene, part.actor), placement=placement))


def _span(part: Part) -> Phrase:
    """Return the numbers of a part's frames."""
    assert part.frames is not None and not isinstance(part.frames, SampledParts)
    first = part.frames.first_frame
    return frame_range(first, first + len(part.present) - 1)


def _absent_note(part: Part) -> Diagnostic:
    if part.frames is None or isinstance(part.frames, SampledParts):
        return note(
            "X003.absent-now: {figure}: absent at that time, not written", figure=part.actor.name
        )
    return note(
        "X003.absent: {figure}: absent in {frames}, not written",
        figure=part.frames.name,
        frames=_span(part),
    )


def _cameras_note(views: Sequence[CameraView]) -> Diagnostic:
    return note(
        "X003.cameras: {n} not written: {names}",
        names=listed([view.name for view in views], 8),
        n=counted(len(views), "camera", "is", "are"),
    )


def _untracked_note(plan: _Plan) -> list[Diagnostic]:
    """Return a note about files of untracked people, or about these people in one file."""
    names = []
    for each, path in plan.groups:
        for part in each.parts:
            person = part.actor.person
            if part.frames is None or isinstance(part.frames, SampledParts):
                continue
            if person is None or is_tracked(person):
                continue
            if plan.kind.folder:
                names.append(person_label(person))
            else:
                names.append(printable(path.name if len(each.parts) == 1 else part.frames.name))
    if not names:
        return []
    return [
        note(
            "X005.untracked: {names}: not tracked, possibly a different person in each frame",
            names=all_of(names),
        )
    ]


def _hidden_note(actors: Sequence[Actor], kind: Exporter) -> list[Diagnostic]:
    count = sum(len(actor.hidden_parts) for actor in actors)
    n = counted(count, "hidden part", "is", "are")
    key = (
        "X003.hidden-parts: {n} not written"
        if kind.omits_hidden
        else "X005.hidden-parts: {n} also written"
    )
    return [note(key, n=n)] if count else []
