"""Comparison of figures or motions with a reference.

Each input is opened like the reference, its actors are paired with those of the reference
(``pair_actors``), and each pair is compared. One input is printed in full, several as a table, all
data as JSON; the distances may be drawn as heat maps with a common scale. The exit code is 1 if
anything differs, and 2 if an input cannot be read.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.commands._frames import parse_range
from viewer.commands._input_files import input_files
from viewer.commands._keywords import arguments_of, paths_of, without_dashes
from viewer.commands._pose import add_skinning_arguments
from viewer.commands._printing import table_lines
from viewer.commands._progress import shown_progress
from viewer.commands._scene import print_warnings
from viewer.commands._settings import add_settings, settings_of
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, described, note
from viewer.diagnostics.record import finite, is_recorded, note_values
from viewer.errors import RigError, UnsupportedFormatError, ViewerError
from viewer.formats import check_targets
from viewer.loading import MotionSettings, load
from viewer.media.image import PICTURES
from viewer.phrases import brief, printable, rounded
from viewer.rendering.options import DisplayOptions
from viewer.rigs.annotations import VertexField
from viewer.rigs.comparison import Difference, Measure, MeasureKind, compare
from viewer.rigs.comparison.pose_errors import PoseErrors, pose_errors
from viewer.rigs.comparison.steps import FrameRange
from viewer.rigs.figure import figure_pose
from viewer.rigs.motion.clip import Clip, suits
from viewer.rigs.motion.sampled_animation import sample_animation
from viewer.rigs.motion.upright import own_up
from viewer.rigs.scalars import length_unit
from viewer.rigs.scene import Actor, Motion, Scene, scene_of
from viewer.rigs.skinning import Skinning
from viewer.rigs.units import METRES
from viewer.streams import require_stdout, summary_stream

if TYPE_CHECKING:
    from viewer.schemas import ComparisonData, DiffData, DifferenceData, PoseErrorData

_UNUSED = "F007.unused-"  # keys of notes that an option had no effect
_DIFFERS = 1  # exit code if there are differences
_UNREADABLE = 2
_N_RANKS = 3  # ranks of clips for an actor: same name, the actor's own clip, any other clip
# Columns of the table, and the names of the measures that they show.
_COLUMNS = {
    "joints": ("joint positions", "captured points"),
    "orientations": ("joint orientations",),
    "vertices": ("vertices", "surface, from the first", "surface, from the second"),
    "weights": ("weights",),
}
# Errors of motions: name and unit.
_ERRORS = {
    "mpjpe": ("MPJPE", "mm"),
    "pa_mpjpe": ("PA-MPJPE", "mm"),
    "pve": ("PVE", "mm"),
    "acceleration": ("acceleration", "mm/s\N{SUPERSCRIPT TWO}"),
    "foot_skate": ("foot skate", "mm/frame"),
}
_NOISE = 1e-6  # millimetres; rounding errors of bodies are below
# Heat maps: size of one, size of a sheet of several, pixels; measures that colour a mesh.
_SIZE = (1280, 960)
_SHEET = (2400, 1800)
_COLORED = ("vertices", "surface, from the first")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.usage = "%(prog)s REFERENCE OTHER ... [options]"
    files = parser.add_argument_group("files")
    files.add_argument(
        "reference",
        metavar="REFERENCE",
        help="a file, several joined by + (arm.skel+arm.skin), or a folder that contains a rig",
    )
    files.add_argument(
        "files", nargs="+", metavar="OTHER", help="a file or folder to compare with it"
    )
    files.add_argument(
        "--with",
        dest="common",
        action="append",
        default=[],
        metavar="FILE",
        help="also open this file with every input, such as the .skel of .anim files",
    )
    add_settings(files, MotionSettings, "up")
    add_settings(files, MotionSettings, "unit", help="length unit of BVH, OBJ and PLY files")
    add_settings(files, MotionSettings, "animation")
    group = parser.add_argument_group("poses")
    group.add_argument(
        "--poses",
        type=int,
        default=8,
        metavar="N",
        help="compare in N poses within the joint limits if there is no motion (default: 8)",
    )
    group.add_argument(
        "--frames",
        metavar="A:B",
        help="frames A to B - 1 of motions, numbered as in the reference (default: all)",
    )
    group = parser.add_argument_group("results")
    group.add_argument(
        "--tolerance",
        type=float,
        metavar="X",
        help="exit with 1 if anything differs by more than X: lengths as a fraction of the "
        "reference's size, angles in radians, weights as stored",
    )
    group.add_argument("--json", action="store_true", help="print everything as JSON")
    group.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help="image of the reference, coloured by distance, in the worst pose; several comparisons "
        "produce a sheet with a common scale",
    )
    group.add_argument("--force", action="store_true", help="replace an existing image")
    add_skinning_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Compare, print the differences, and return 1 if any exceeds the tolerance."""
    tolerance = arguments.tolerance
    if tolerance is not None and not (tolerance >= 0.0 and math.isfinite(tolerance)):
        raise ViewerError(f"--tolerance: expected 0 or more, found {tolerance:g}")
    span = _checked_span(arguments)
    # Missing files are reported when they are opened.
    inputs = [Path(file) for file in arguments.common]
    for text in (arguments.reference, *arguments.files):
        with contextlib.suppress(ViewerError):
            inputs += input_files(text)
    output = None if arguments.output is None else Path(arguments.output)
    if output is not None:
        require_stdout(output)
        if output.suffix.lower() not in PICTURES:
            raise UnsupportedFormatError(
                f"{printable(output, 300)}: expected an image ({', '.join(PICTURES)}), "
                f'found "{output.suffix}"'
            )
        check_targets([output], inputs, arguments.force)
    settings = settings_of(MotionSettings, arguments)

    def open_one(text: str) -> Scene:
        return load(*arguments.common, *input_files(text), motion=settings)

    reference = open_one(arguments.reference)
    skinning = settings_of(Skinning, arguments)
    rows: list[Comparison] = []
    heats: list[_Heat] = []
    inputs += reference.files
    said = reference.diagnostics
    for name in arguments.files:
        try:
            other = open_one(name)
            inputs += other.files
            said = _unless_used(said, other)
            row, heat = _compared(name, reference, other, skinning, arguments.poses, span)
        except ViewerError as problem:
            row, heat = Comparison(name, error=printable(problem, 500)), None
        rows.append(row)
        heats += [] if heat is None else [heat]
    print_warnings(said)
    stream = sys.stdout if output is None else summary_stream(output)
    if output is not None:
        check_targets([output], inputs, arguments.force)
    if arguments.json or is_recorded():
        found = _json_data(arguments.reference, rows, tolerance)
        note_values(found)
    if arguments.json:
        print(json.dumps(found, indent=2, ensure_ascii=False), file=stream)
    elif len(rows) > 1:
        print("\n".join(_table_of(rows, tolerance)), file=stream)
    else:
        print_warnings(rows[0].diagnostics)
        print("\n".join(_lines_of(rows[0], tolerance)), file=stream)
    if output is not None:
        summary = _save_heat(heats, output, skinning)
        print(summary, file=sys.stderr if arguments.json else stream)
    if any(row.error for row in rows):
        return _UNREADABLE
    exceeds = tolerance is not None and any(row.exceeds(tolerance) for row in rows)
    return _DIFFERS if exceeds else 0


def _checked_span(arguments: argparse.Namespace) -> FrameRange | None:
    """Return the requested frames; check them and the number of poses."""
    if not 0 <= arguments.poses <= 10_000:
        raise ViewerError(f"--poses: expected 0 to 10000, found {arguments.poses}")
    frames = None if arguments.frames is None else parse_range(arguments.frames)
    if frames is not None and frames.step != 1:
        raise ViewerError(f"--frames: expected A:B without a step, found {arguments.frames}")
    return None if frames is None else (frames.first, frames.stop)


def diff(
    reference: Scene | Actor | str | Path | Sequence[str | Path],
    other: Scene | Actor | str | Path | Sequence[str | Path],
    **options: object,
) -> Comparison:
    """Compare figures or motions with a reference, as ``viewer diff`` does.

    Parameters
    ----------
    reference : Scene, Actor, path, or sequence of paths
        Lengths are in its unit; several paths are opened as one scene.
    other : Scene, Actor, path, or sequence of paths
        What is compared with it; actors are paired by names, then by kind, then in order.
    **options
        Options of the command with underscores: ``poses``, ``frames`` (a range), the skinning
        method; for files also ``up``, ``unit`` and ``animation``.

    Returns
    -------
    Comparison
        ``differences`` of joints, vertices, orientations and weights by actor. For motions, or
        poses, of figures with equal joints and known units: ``mpjpe``, ``pa_mpjpe``, ``pve`` and
        ``foot_skate`` in millimetres, and ``acceleration``; ``viewer help python`` defines them.

    Raises
    ------
    ViewerError
        If there is no such option or value, or a file cannot be read.
    RigError
        By ``mpjpe`` and the others, if joints, frames or rates differ, or units are unknown.

    >>> import viewer
    >>> fox = viewer.load("fox")
    >>> viewer.diff(fox, fox, poses=2).exceeds(0.0)
    False
    """
    without = ("output", "force", "json", "tolerance", "with")
    arguments = arguments_of("diff", add_arguments, options, without, ["a", "b"])
    with without_dashes():
        span, skinning = _checked_span(arguments), settings_of(Skinning, arguments)
        settings = settings_of(MotionSettings, arguments)
    scenes = [
        scene_of(what, "diff")
        if isinstance(what, Scene | Actor)
        else load(*paths_of("diff", what), motion=settings)
        for what in (reference, other)
    ]
    name = other if isinstance(other, str | Path) else scenes[1].title or "the other"
    return _compared(str(name), scenes[0], scenes[1], skinning, arguments.poses, span)[0]


def _compared(
    name: str,
    reference: Scene,
    other: Scene,
    skinning: Skinning,
    n_poses: int,
    frames: FrameRange | None,
) -> tuple[Comparison, _Heat | None]:
    pairing = pair_actors(reference.actors, other.actors)
    is_choice = len(reference.actors) > 1 or len(other.actors) > 1
    found: list[tuple[Actor, Difference]] = []
    errors: list[PoseErrors | str] = []
    for first, second in pairing.pairs:
        notes = _notes_on_pair(reference, other, first, second, is_choice)
        # Comparing poses the reference, which must start in the same pose for each input.
        posed = first.copy()
        with shown_progress(f"comparing {Path(name).name}"):
            difference = compare(posed, second.copy(), skinning, n_poses, frames)
            errors.append(_pose_errors(first, second, frames))
        found.append((posed, replace(difference, notes=(*notes, *difference.notes))))
    differences = tuple((actor.name, difference) for actor, difference in found)
    lone, said = _lone(name, pairing), _unless_used(other.diagnostics, reference)
    row = Comparison(name, differences, lone, "", said, tuple(errors))
    return row, _heat_of(name, found)


def _unless_used(said: tuple[Diagnostic, ...], other: Scene) -> tuple[Diagnostic, ...]:
    """Return what was said about one scene without options that had an effect on the other."""
    unused = {found.key for found in other.diagnostics}
    return tuple(
        found for found in said if not found.key.startswith(_UNUSED) or found.key in unused
    )


def _notes_on_pair(
    reference: Scene, other: Scene, first: Actor, second: Actor, is_choice: bool
) -> tuple[Diagnostic, ...]:
    """Return notes on the names and up axes of a pair."""
    notes = []
    if is_choice and first.figure.name != second.figure.name:
        notes.append(note("D002.partner: compared with {name}", name=brief(second.name)))
    # A figure in a motion is upright along the axis of the motion, whatever its own one.
    ups = own_up(reference, first)[0], own_up(other, second)[0]
    if ups[0] != ups[1]:
        notes.append(
            note(
                "D002.up: up axes differ ({first} and {second}): compared without conversion",
                first=ups[0],
                second=ups[1],
            )
        )
    return tuple(notes)


def _pose_errors(reference: Actor, found: Actor, frames: FrameRange | None) -> PoseErrors | str:
    """Return the errors of an actor in the frames of a range, or why there are none."""
    try:
        if frames is None:
            return pose_errors(found, reference)
        sampled = sample_animation(reference)
        low, count = sampled.first_frame, sampled.frames.n_frames
        first, stop = (None if end is None else max(end - low, 0) for end in frames)
        return pose_errors(found, reference, (first or 0, count if stop is None else stop))
    except RigError as problem:
        return str(problem)


def _lone(name: str, pairing: _Pairing) -> tuple[Diagnostic, ...]:
    """Return messages about actors and motions that are present in only one of the scenes."""
    sides = ((Phrase("the reference"), pairing.first), (name, pairing.second))
    return tuple(
        note("D001.actor: only in {side}: {actor}", side=side, actor=one)
        for side, lone in sides
        for one in lone
    )


@dataclass(frozen=True, slots=True)
class _Pairing:
    """Paired actors of two scenes."""

    pairs: tuple[tuple[Actor, Actor], ...]
    """tuple of (Actor, Actor). In the first scene's order; each with the motion to compare."""
    first: tuple[Phrase, ...] = ()
    second: tuple[Phrase, ...] = ()
    """Labels of everything unpaired: actors, and motions that belong only to unpaired actors."""


# Each rule is tried for all actors before the next rule.
_RULES: tuple[Callable[[Actor, Actor], bool], ...] = (
    lambda one, other: one.figure.name == other.figure.name and _kind(one) == _kind(other),
    lambda one, other: one.figure.name == other.figure.name,
    lambda one, other: _kind(one) == _kind(other),
    lambda one, other: True,
)


def pair_actors(first: Sequence[Actor], second: Sequence[Actor]) -> _Pairing:
    """Pair the actors of a reference and another scene, and the motions of paired actors.

    People of captures are paired by their number. Actors with the same name are paired first, of
    the same kind if there are several; then actors of the same kind, such as skinned figures; then
    the remaining ones, in order. Keyframed clips are assigned to any skeleton they fit when files
    are opened, so a clip with the same name as the other actor's clip takes precedence, then the
    actor's own, then one assigned to an unpaired actor.
    """
    found: dict[int, int] = {}
    taken: set[int] = set()
    for rule in _RULES:
        for index, actor in enumerate(first):
            if index in found:
                continue
            open_ones = (n for n in range(len(second)) if n not in taken)
            alike = (n for n in open_ones if actor.person == second[n].person)
            chosen = next((n for n in alike if rule(actor, second[n])), None)
            if chosen is not None:
                found[index] = chosen
                taken.add(chosen)
    chosen_pairs = [(first[index], second[found[index]]) for index in sorted(found)]
    left = [actor for index, actor in enumerate(first) if index not in found]
    other_left = [actor for index, actor in enumerate(second) if index not in taken]
    ones, others = [one for one, _ in chosen_pairs], [other for _, other in chosen_pairs]
    dealt, other_clips = _with_clips(others, other_left, [one.clip for one in ones])
    dealt_ones, clips = _with_clips(ones, left, [other.clip for other in dealt])
    return _Pairing(
        tuple(zip(dealt_ones, dealt, strict=True)),
        _lone_actors(left, clips),
        _lone_actors(other_left, other_clips),
    )


def _kind(actor: Actor) -> tuple[bool, bool, bool]:
    figure = actor.figure
    return figure.skeleton is not None, figure.mesh is not None, figure.points is not None


def _lone_actors(actors: Sequence[Actor], clips: Sequence[Clip]) -> tuple[Phrase, ...]:
    """Return labels of unpaired clips and actors, by kind unless they have mesh and skeleton."""
    kinds = {
        (True, False, False): "{name} (a skeleton)",
        (False, True, False): "{name} (a mesh)",
        (False, False, True): "{name} (captured points)",
    }
    figures = (Phrase(kinds.get(_kind(one), "{name}"), name=brief(one.name)) for one in actors)
    return (*figures, *(Phrase("motion {name}", name=brief(clip.name)) for clip in clips))


def _with_clips(
    actors: Sequence[Actor], lone: Sequence[Actor], partners: Sequence[Motion | None]
) -> tuple[list[Actor], list[Clip]]:
    """Return actors with the keyframed clips to compare, and the remaining clips."""
    # The clips of unpaired actors may belong to paired ones, whose counterparts have ``partners``.
    pool = [c for actor in (*actors, *lone) if (c := actor.clip) is not None and c.kind == "curves"]
    if not pool:
        return list(actors), []
    moves = [actor.clip is None or actor.clip.kind == "curves" for actor in actors]
    dealt: dict[int, Clip] = {}
    for rank in range(_N_RANKS):
        for index, (actor, partner) in enumerate(zip(actors, partners, strict=True)):
            if index in dealt or not moves[index]:
                continue
            own = actor.figure.skeleton
            ranked = [clip for clip in pool if _rank(clip, actor, partner) == rank]
            fitting = [clip for clip in ranked if own is not None and suits(clip, own)]
            if fitting:
                # Among clips with the same name, the actor's own comes first.
                dealt[index] = next((c for c in fitting if c is actor.clip), fitting[0])
                pool.remove(dealt[index])
    found = [
        _moved_by(actor, dealt.get(index)) if moves[index] else actor
        for index, actor in enumerate(actors)
    ]
    return found, pool


def _rank(clip: Clip, actor: Actor, partner: Motion | None) -> int:
    """Return the rank of a clip's match with the other motion: 0 is best, ``_N_RANKS`` no match."""
    if partner is not None and (partner.kind, partner.name) == (clip.kind, clip.name):
        return 0
    if clip is actor.clip:
        return 1
    return _N_RANKS if partner is None else _N_RANKS - 1


def _moved_by(actor: Actor, clip: Clip | None) -> Actor:
    """Return an actor with a clip, or in its current pose if there is none."""
    if clip is actor.clip:
        return actor
    return replace(actor, clip=clip, own_pose=figure_pose(actor.figure))


@dataclass(frozen=True, slots=True)
class Comparison:
    """Comparison of one input with the reference; ``str`` is what ``viewer diff`` prints."""

    name: str
    """The argument as given."""
    differences: tuple[tuple[str, Difference], ...] = ()
    """One per actor, with the actor's name in the reference."""
    mismatches: tuple[Diagnostic, ...] = ()
    """Actors without a counterpart, and the scene that contains them."""
    error: str = ""
    """Reason why the input could not be opened; empty if it was."""
    diagnostics: tuple[Diagnostic, ...] = field(default=())
    """Warnings of the file readers."""
    pose_errors: tuple[PoseErrors | str, ...] = ()
    """For each actor, its errors as papers state them, or why there are none."""

    @property
    def mpjpe(self) -> float:
        """Mean per-joint position error with the roots moved together, millimetres."""
        return self._errors().mpjpe

    @property
    def pa_mpjpe(self) -> float:
        """Mean per-joint position error after Procrustes alignment, millimetres."""
        return self._errors().pa_mpjpe

    @property
    def pve(self) -> float:
        """Per-vertex error with the roots moved together, millimetres; NaN without equal meshes."""
        return self._errors().pve

    @property
    def acceleration(self) -> float:
        """Acceleration error of the joints, millimetres per squared second."""
        return self._errors().acceleration

    @property
    def foot_skate(self) -> float:
        """Mean step of feet that stand in the reference, millimetres per frame."""
        return self._errors().foot_skate

    def _errors(self) -> PoseErrors:
        """Return the errors of the first actor; RigError if there are none."""
        found = self.pose_errors[0] if self.pose_errors else "no actors in common"
        if isinstance(found, str):
            raise RigError(found)
        return found

    def to_dict(self) -> ComparisonData:
        """Return an entry of ``comparisons`` in the data of ``viewer diff --json``."""
        return _comparison_data(self, None)

    def __str__(self) -> str:
        return "\n".join(_lines_of(self, None))

    def __repr__(self) -> str:
        return f"<Comparison {self}>"

    def exceeds(self, tolerance: float) -> bool:
        """Return whether anything differs by more than the tolerance or was not compared."""
        parts = (difference.exceeds(tolerance) for _, difference in self.differences)
        return bool(self.error or self.mismatches or not self.differences) or any(parts)


def _amount(value: float, kind: MeasureKind, difference: Difference) -> str:
    """Return a number as text: lengths in millimetres or as a fraction of the size."""
    if kind == "angle":
        return f"{rounded(math.degrees(value), 4)}\N{DEGREE SIGN}"
    if kind == "weight":
        return rounded(value, 4)
    if difference.unit in METRES:
        metres = METRES[difference.unit] * value
        return f"{rounded(metres, 4)} m" if metres >= 1.0 else f"{rounded(1000.0 * metres, 4)} mm"
    percent = 100.0 * value / difference.size if difference.size > 0.0 else math.nan
    return f"{rounded(value, 4)} ({rounded(percent)} % of the size)"


def _lines_of(compared: Comparison, tolerance: float | None) -> list[str]:
    """Return the lines of one comparison."""
    lines = [f"{printable(compared.name, 300)}:"]
    if compared.error:
        return [*lines, f"  could not be compared: {compared.error}"]
    lines += [f"  {text}" for text in compared.mismatches]
    many = len(compared.differences) > 1 or bool(compared.mismatches)
    pairs = zip(compared.differences, compared.pose_errors, strict=True)
    for (name, difference), errors in pairs:
        if many:
            lines.append(f"  {printable(name)}:")
        lines += [f"    differs: {text}" for text in difference.mismatches]
        lines += [f"    note: {text}" for text in difference.notes]
        lines += [_line(measure, difference) for measure in difference.measures]
        lines += _error_lines(errors)
        if not difference.measures:
            lines.append("    nothing in common to compare")
    if tolerance is not None:
        verdict = "differs by more than" if compared.exceeds(tolerance) else "within"
        lines.append(f"  {verdict} the tolerance of {tolerance:g}")
    return lines


def _error_lines(errors: PoseErrors | str) -> list[str]:
    """Return a line of the errors that are known, for motions only; none if there are none."""
    if isinstance(errors, str) or errors.n_frames < 2:
        return []
    known = [
        f"{title} {rounded(value if value > _NOISE else 0.0, 4)} {unit}"
        for name, (title, unit) in _ERRORS.items()
        if math.isfinite(value := getattr(errors, name))
    ]
    return [f"    errors of the motion: {', '.join(known)}"]


def _line(measure: Measure, difference: Difference) -> str:
    most = _amount(measure.maximum, measure.kind, difference)
    mean = _amount(measure.mean, measure.kind, difference)
    place = ", ".join(filter(None, (printable(measure.item), measure.step)))
    where = f" ({place})" if measure.maximum > 0.0 else ""
    return f"    {measure.name}: at most {most}{where}, mean {mean}"


def _table_of(rows: Sequence[Comparison], tolerance: float | None) -> list[str]:
    """Return one line per comparison: the largest differences over all its actors."""
    heads = ["", *_COLUMNS, "result"]
    table = [heads, *([printable(row.name, 60), *_cells(row, tolerance)] for row in rows)]
    return table_lines(table, right=range(1, len(heads) - 1))


def _cells(row: Comparison, tolerance: float | None) -> list[str]:
    cells = []
    for names in _COLUMNS.values():
        found = [
            (measure, difference)
            for _, difference in row.differences
            for measure in difference.measures
            if measure.name in names
        ]
        # Relative to each reference's size, because figures in a scene may have different units.
        worst = max(found, key=lambda pair: pair[0].relative(pair[1].size), default=None)
        cells.append("-" if worst is None else _amount(worst[0].maximum, worst[0].kind, worst[1]))
    count = len(row.mismatches) + sum(len(d.mismatches) for _, d in row.differences)
    result = [row.error] if row.error else []
    if not row.error and tolerance is not None:
        result.append("DIFFERS" if row.exceeds(tolerance) else "within")
    if count:
        result.append(f"{count} mismatch{'es' if count > 1 else ''}")
    return [*cells, ", ".join(result)]


def _json_data(reference: str, rows: Sequence[Comparison], tolerance: float | None) -> DiffData:
    """Return the whole report as JSON data; lengths in the reference's unit, angles in radians."""
    return {
        "schema": "diff/1",
        "reference": reference,
        "tolerance": tolerance,
        "comparisons": [_comparison_data(row, tolerance) for row in rows],
    }


def _comparison_data(row: Comparison, tolerance: float | None) -> ComparisonData:
    pairs = zip(row.differences, row.pose_errors, strict=True)
    return {
        "name": row.name,
        "error": row.error or None,
        "within": None if tolerance is None else not row.exceeds(tolerance),
        "mismatches": [str(found) for found in row.mismatches],
        "warnings": [str(found) for found in row.diagnostics],
        "diagnostics": [described(found) for found in (*row.diagnostics, *row.mismatches)],
        "actors": [_actor(name, difference, errors) for (name, difference), errors in pairs],
    }


def _actor(name: str, difference: Difference, errors: PoseErrors | str) -> DifferenceData:
    return {
        "name": name,
        "pose_errors": None if isinstance(errors, str) else _errors_data(errors),
        "size": difference.size,
        "unit": difference.unit or None,
        "mismatches": [str(found) for found in difference.mismatches],
        "notes": [str(found) for found in difference.notes],
        "diagnostics": [described(found) for found in (*difference.mismatches, *difference.notes)],
        "measures": [
            {
                "name": measure.name,
                "kind": measure.kind,
                "maximum": measure.maximum,
                "mean": measure.mean,
                "relative": measure.relative(difference.size),
                "step": measure.step or None,
                "item": measure.item,
                "compared": measure.n_compared,
                "maxima": dict(zip(measure.items, measure.item_maxima.tolist(), strict=True))
                if measure.items
                else None,
            }
            for measure in difference.measures
        ],
    }


def _errors_data(errors: PoseErrors) -> PoseErrorData:
    """Return errors of a motion as JSON data."""
    return {
        "mpjpe": finite(errors.mpjpe),
        "pa_mpjpe": finite(errors.pa_mpjpe),
        "pve": finite(errors.pve),
        "acceleration": finite(errors.acceleration),
        "foot_skate": finite(errors.foot_skate),
        "frames": errors.n_frames,
    }


@dataclass(frozen=True, slots=True, eq=False)
class _Heat:
    """Heat map of the reference, coloured by its distance to another figure."""

    actors: tuple[Actor, ...]
    """Actors in the pose with the largest distance, with the field ``difference``."""
    most: float
    """The largest distance, in the unit of the legend."""


def _heat_of(name: str, posed: Sequence[tuple[Actor, Difference]]) -> _Heat | None:
    """Return the heat map of the reference's actors in their worst poses; None without a mesh."""
    actors, most = [], 0.0
    for actor, difference in posed:
        measure = next((one for one in difference.measures if one.name in _COLORED), None)
        if measure is None:
            continue
        title = f"Distance of {printable(Path(name.split('+')[0]).name or name, 40)}"
        field = VertexField("difference", title, measure.item_maxima, "length")
        figure = replace(actor.figure, fields=(field,))
        pose = None if actor.own_pose is None else actor.own_pose.copy()
        actors.append(Actor(figure, pose))
        most = max(most, length_unit(figure)[0] * measure.maximum)
    return _Heat(tuple(actors), most) if actors else None


def _save_heat(heats: Sequence[_Heat], output: Path, skinning: Skinning) -> str:
    """Write one image, or a sheet of several with a common scale; return a summary line."""
    from viewer.formats import save_image
    from viewer.media.picture_sinks import SheetSink
    from viewer.rendering.offscreen import render

    if not heats:
        raise ViewerError(f"{printable(output, 300)}: no common mesh to colour")
    most = max(heat.most for heat in heats)
    options = DisplayOptions(
        shading="scalar",
        scalar="field:difference",
        scalar_range=(0.0, most) if most > 0.0 else None,
        legend=True,
        grid=False,
        skinning=skinning,
    )
    size = _SIZE if len(heats) == 1 else _SHEET
    sink = SheetSink(output, size, range(1, len(heats) + 1))
    for number, heat in enumerate(heats):
        pixels = render(Scene(list(heat.actors)), sink.cell, None, options)
        if len(heats) == 1:
            save_image(output, pixels)
            return f"{printable(output)}: the largest distance at each vertex"
        sink.write(number, pixels)
    sink.close()
    return f"{printable(output)}: {len(heats)} heat maps with a common scale"
