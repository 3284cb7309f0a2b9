"""The data that commands print as JSON, and ``viewer batch`` writes into its reports.

Each kind has a name with a version, which is the value of ``schema`` in the data. The version
changes if a key is removed or changes its meaning; new keys may appear without that. The tables of
``viewer help json`` and the JSON schemas are made from the classes below.
"""

from __future__ import annotations

from types import NoneType, UnionType
from typing import (
    Any,
    Literal,
    NotRequired,
    TypeAlias,
    TypedDict,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

Severity: TypeAlias = Literal["note", "warning", "error"]


class DiagnosticData(TypedDict):
    """An error, a warning or a note."""

    code: str
    """Code, such as ``W004``; ``viewer lint --codes`` lists them."""
    key: str
    """Code and name of the message, which stay the same if its wording changes."""
    severity: Severity
    message: str
    """The message in one line."""
    file: str | None
    """The file that it is about."""
    line: int | None
    """Line of the file, from 1."""
    pointer: str
    """JSON pointer to an element of a glTF file, or empty."""
    part: str | None
    """What ``places`` are indices of, such as ``weights``."""
    places: list[int]
    """Indices of the elements, at most 100."""
    n_places: int
    """Number of all elements."""
    count: int
    """Number of equal messages that were merged."""
    values: dict[str, Any]
    """The numbers and names in the message."""


class SaidData(TypedDict):
    """A warning or note that is only text."""

    severity: Severity
    message: str


class FindingData(TypedDict):
    """A finding of ``viewer lint``."""

    code: str
    """Code, such as ``W004``; ``viewer lint --codes`` lists them."""
    severity: Severity
    title: str
    """What the code means."""
    message: str
    """The message in one line."""
    hint: str
    """What to do."""
    file: str | None
    """The file that it is about."""
    line: int | None
    """Line of the file, from 1."""
    pointer: str
    """JSON pointer to an element of a glTF file, or empty."""
    actor: int | None
    """Index of the figure among those that the files contain."""
    name: str
    """Name of the figure."""
    animation: str | None
    """Name of the animation, if the figure has several."""
    key: str
    """Code and name of the message, which stay the same if its wording changes."""
    part: str | None
    """What ``places`` are indices of in the file."""
    places: list[int]
    """Indices in the file, at most 100."""
    n_places: int
    """Number of all of them."""
    count: int
    """Number of equal messages that were merged."""
    values: dict[str, Any]
    """The numbers and names in the message."""
    vertices: list[int]
    """Vertices of the figure, worst first, at most 100; likewise the other lists."""
    n_vertices: int
    triangles: list[int]
    n_triangles: int
    joints: list[int]
    """Joints of the figure, or captured points."""
    n_joints: int
    joint_names: list[str]
    """Names of ``joints``."""
    frames: list[int]
    """Frames, numbered as in the file."""
    n_frames: int
    times: list[float]
    """Seconds of ``frames``."""
    n_times: int


class CountData(TypedDict):
    """Numbers of findings."""

    error: int
    warning: int
    note: int


class BodyData(TypedDict):
    """A captured body."""

    name: str
    model: str | None
    """Model that its file states, such as ``SMPL+H``."""
    gender: str | None


class LintData(TypedDict):
    """The data of ``viewer lint --json`` and ``viewer.lint(…).to_dict()``."""

    schema: Literal["lint/1"]
    findings: list[FindingData]
    """Worst first."""
    counts: CountData
    bodies: list[BodyData]


class MeasureData(TypedDict):
    """The difference of one property."""

    name: str
    """``joint positions``, ``joint orientations``, ``vertices``, ``weights`` and others."""
    kind: Literal["length", "angle", "weight"]
    """Lengths are in the reference's unit, angles in radians."""
    maximum: float
    mean: float
    """Over all items and steps."""
    relative: float
    """The value that ``--tolerance`` applies to: lengths as a fraction of the size."""
    step: str | None
    """Frame or pose of the maximum."""
    item: str
    """Joint or vertex of the maximum."""
    compared: int
    """Number of values in the mean."""
    maxima: dict[str, float] | None
    """Largest value of each joint; null for vertices."""


class PoseErrorData(TypedDict):
    """Errors as papers on body capture state them; ``viewer help python`` defines them."""

    mpjpe: float | None
    """mm; null if it cannot be computed, like the others."""
    pa_mpjpe: float | None
    """mm."""
    pve: float | None
    """mm."""
    acceleration: float | None
    """mm/s²."""
    foot_skate: float | None
    """mm per frame."""
    frames: int
    """Number of frames in which both are present."""


class DifferenceData(TypedDict):
    """The difference of one figure."""

    name: str
    """Name of the figure in the reference."""
    pose_errors: PoseErrorData | None
    """Null for other joints, frames or rates, and for unknown units."""
    size: float
    """Diagonal of the reference's box."""
    unit: str | None
    """Unit of the reference."""
    mismatches: list[str]
    """What only one of the two has."""
    notes: list[str]
    """How they were compared."""
    diagnostics: list[DiagnosticData]
    """Both as data."""
    measures: list[MeasureData]


class ComparisonData(TypedDict):
    """One input, compared with the reference."""

    name: str
    """The input as given."""
    error: str | None
    """Why it could not be opened."""
    within: bool | None
    """Whether all is within the tolerance; null without one."""
    mismatches: list[str]
    """Figures and motions that only one of the two has."""
    warnings: list[str]
    """Messages of the readers."""
    diagnostics: list[DiagnosticData]
    """Both as data."""
    actors: list[DifferenceData]


class DiffData(TypedDict):
    """The data of ``viewer diff --json``."""

    schema: Literal["diff/1"]
    reference: str
    """The reference as given."""
    tolerance: float | None
    comparisons: list[ComparisonData]


class JointData(TypedDict):
    """A joint."""

    index: int
    name: str
    label: str
    """Name that is unique in the skeleton."""
    parent: int
    """Index of its parent; -1 for a root."""
    position: list[float]
    """x, y and z in the scene, in the current pose."""


class DofData(TypedDict):
    """A degree of freedom."""

    name: str
    """Joint and axis, such as ``head.x`` or ``pelvis.tx``."""
    value: float
    """Radians or figure units."""
    minimum: float | None
    maximum: float | None
    """Limits; null for none."""


class SkeletonData(TypedDict):
    """A skeleton."""

    joints: int
    roots: int
    dofs: int
    locked_dofs: int
    limited_dofs: int
    joint_table: list[JointData]
    dof_table: list[DofData]


class PartData(TypedDict):
    """A part of a mesh."""

    name: str
    triangles: int


class RimData(TypedDict):
    """Rim light of a toon material."""

    color: list[float]
    power: float
    matcap: str | None


class OutlineData(TypedDict):
    """Outline of a toon material."""

    mode: str
    width: float
    color: list[float]


class ToonData(TypedDict):
    """A toon material."""

    shade_color: list[float] | None
    shade_range: list[float]
    rim: RimData | None
    outline: OutlineData | None


class MaterialData(TypedDict):
    """A material."""

    name: str
    texture: str | None
    """File or name of its image."""
    pixels: list[int] | None
    """Width and height of the image; null if it was not found."""
    base_color: NotRequired[list[float] | None]
    """Linear; this and the following only for materials with more than a texture."""
    maps: NotRequired[dict[str, str]]
    """Other images, by kind."""
    alpha: NotRequired[str]
    metallic: NotRequired[float]
    roughness: NotRequired[float]
    toon: NotRequired[ToonData]


class MeshData(TypedDict):
    """A mesh."""

    vertices: int
    triangles: int
    degenerate_triangles: int
    unused_vertices: int
    normal_lengths: list[float]
    """Lowest and highest length of the normals."""
    has_uvs: bool
    has_colors: bool
    parts: list[PartData]
    materials: list[MaterialData]


class SkinData(TypedDict):
    """A skin."""

    bindings: int
    """Number of joints with a bind matrix."""
    influences: int
    influence_histogram: dict[str, int]
    """Number of vertices by number of influences."""
    mean_influences: float
    weight_sums: list[float]
    """Lowest and highest sum; empty if no vertex has an influence."""
    zero_weights: int
    negative_weights: int
    vertices_without_influence: int
    joints_without_vertices: list[int]


class MorphData(TypedDict):
    """A morph target."""

    name: str
    vertices: int
    """Number of vertices that it moves."""
    materials: int
    """Number of materials that it changes."""


class ClipData(TypedDict):
    """The motion that plays; the keys depend on its kind."""

    name: str
    range: list[float]
    """First and last second."""
    model: str | None
    gender: str | None
    """Model and gender of a captured body."""
    kind: NotRequired[Literal["transforms", "sampled", "points"]]
    """Keys of joints, frames of joints, or frames of points; missing for ``.anim``."""
    channels: NotRequired[int]
    keys: NotRequired[int]
    key_times: NotRequired[list[float]]
    """First and last second of the keys; empty if there are none."""
    extrapolation: NotRequired[dict[str, int]]
    """Number of channels by mode."""
    paths: NotRequired[dict[str, int]]
    interpolation: NotRequired[dict[str, int]]
    regular: NotRequired[bool]
    """Whether all keys are at frames."""
    frame_rate: NotRequired[float]
    frames: NotRequired[int]
    first_frame: NotRequired[int]
    present_frames: NotRequired[int]
    gaps: NotRequired[list[list[int]]]
    """First and last number of each gap."""
    joints: NotRequired[int]
    shape_weights: NotRequired[int]
    shape_varies: NotRequired[bool]
    points: NotRequired[int]
    seen: NotRequired[float]
    """Fraction of points that are visible."""


class AnimationData(TypedDict):
    """An animation of a file."""

    number: int
    """From 1, as for ``--animation``."""
    name: str
    range: list[float]
    """First and last second."""
    plays: bool
    error: NotRequired[str]
    """Why it cannot be played."""


class ShapeData(TypedDict):
    """A blend shape."""

    name: str
    group: str


class RestData(TypedDict):
    """A body at rest."""

    height: float
    """Metres."""
    volume: float | None
    """Cubic metres; null for an open mesh."""
    mass: float | None
    """Kilograms at 985 kg/m³."""


class ReducedData(TypedDict):
    """A smaller mesh of the same body."""

    vertices: int
    triangles: int


class ModelData(TypedDict):
    """Properties of a body model, and of the pose."""

    facts: NotRequired[dict[str, str]]
    """Facts from the file, by heading."""
    shapes: NotRequired[list[ShapeData]]
    rest: NotRequired[RestData]
    shape_weights: NotRequired[list[float]]
    figure_translation: NotRequired[list[float]]
    figure_scale: NotRequired[float]
    own_numbers: NotRequired[list[float]]
    """The pose as the numbers of the model's files."""
    body_parts: NotRequired[dict[str, int]]
    """Number of vertices by part."""
    keypoints: NotRequired[list[str]]
    reduced: NotRequired[ReducedData]
    asymmetry: NotRequired[float]
    """Largest difference of left and right, figure units."""
    effects: dict[str, float]
    """Largest distance between ways of skinning in this pose, figure units."""


class ActorData(TypedDict):
    """A figure of a scene."""

    name: str
    figure: str
    up: Literal["y", "z"]
    present: bool
    """Whether it is present at this time."""
    box: list[list[float]] | None
    """Lowest and highest corner in the scene."""
    size: float | None
    """Diagonal of the box."""
    attached: bool
    """Whether it has a mesh, a skeleton and a skin."""
    unit: str | None
    skeleton: NotRequired[SkeletonData]
    mesh: NotRequired[MeshData]
    skin: NotRequired[SkinData]
    morphs: NotRequired[list[MorphData]]
    clip: NotRequired[ClipData]
    animations: NotRequired[list[AnimationData]]
    model: ModelData


class InfoData(TypedDict):
    """The data of ``viewer info --json``: lengths in figure units, angles in radians."""

    schema: Literal["info/1"]
    actors: list[ActorData]
    captures: list[list[str]]
    """Facts about captures: heading and text."""
    cameras: list[str]
    warnings: list[str]
    """Messages of the readers."""
    diagnostics: list[DiagnosticData]
    """The same as data."""


class BatchData(TypedDict):
    """A line of the report of ``viewer batch``, the result of one input."""

    schema: Literal["batch/1"]
    index: int
    """Position in the sorted list of all inputs."""
    files: list[str]
    output: str
    """File or folder that the job writes, or empty."""
    name: str
    """Path relative to the common folder of all inputs."""
    status: Literal["done", "failed", "timeout", "crashed", "memory", "cancelled", "unchanged"]
    exit_code: int
    """Exit code of the command."""
    seconds: float
    attempts: int
    message: str
    """The error in one line, or empty."""
    diagnostics: list[DiagnosticData | SaidData]
    outputs: list[str]
    """Files and folders written."""
    text: str
    """What the command printed."""
    values: dict[str, Any]
    """Data of the command: those of ``info``, ``lint`` or ``diff``, or what a function returned."""
    key: str
    """Hash of inputs, options and version, by which ``--resume`` recognises finished inputs."""
    time: float
    """When it ended, seconds since 1970."""


KINDS: dict[str, type] = {
    "lint/1": LintData,
    "diff/1": DiffData,
    "info/1": InfoData,
    "batch/1": BatchData,
}
"""The kinds of data by the value of ``schema``."""

_DRAFT = "https://json-schema.org/draft/2020-12/schema"
_SCALARS = {str: "string", bool: "boolean", int: "integer", float: "number", NoneType: "null"}


def json_schema(name: str) -> dict[str, Any]:
    """Return the JSON schema of a key of ``KINDS``, such as ``"lint/1"``, for other programs."""
    types: dict[str, Any] = {}
    found = _schema_of(KINDS[name], types)
    return {"$schema": _DRAFT, "$id": f"viewer/{name}", **found, "$defs": types}


def _schema_of(kind: Any, types: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a type; those of classes are added to ``types``."""
    origin, arguments = get_origin(kind), get_args(kind)
    if kind is Any:
        return {}
    if origin is NotRequired:
        return _schema_of(arguments[0], types)
    if origin is Literal:
        return {"enum": [*arguments]}
    if origin is UnionType:
        return {"anyOf": [_schema_of(each, types) for each in arguments]}
    if origin is list:
        return {"type": "array", "items": _schema_of(arguments[0], types)}
    if origin is dict:
        return {"type": "object", "additionalProperties": _schema_of(arguments[1], types)}
    if not is_typeddict(kind):
        return {"type": _SCALARS[kind]}
    if kind.__name__ not in types:
        types[kind.__name__] = {}  # known before its members, which may contain it
        members = get_type_hints(kind, include_extras=True)
        types[kind.__name__] = {
            "type": "object",
            "properties": {name: _schema_of(each, types) for name, each in members.items()},
            "required": [n for n, each in members.items() if get_origin(each) is not NotRequired],
        }
    return {"$ref": f"#/$defs/{kind.__name__}"}
