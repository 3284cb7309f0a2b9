"""Exporter for one HTML file that shows figures in any browser with WebGL 2, without a network.

The page has the shaders of the desktop, so that skinning and shading are the same: the texts of
``shaders/`` in GLSL ES 3.00 (``rendering/shader_text.py``). Python computes what the desktop
computes on the processor; the page unpacks it (``decode.js``), interpolates frames and makes the
matrices of the shaders (``tracks.js``), draws (``drawing.js``, ``figure.js``, ``ground.js``), and
has a camera (``camera.js``) and controls (``page.js``). Its content security policy permits these
scripts and no others, and no connection of any kind.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
from collections.abc import Sequence
from dataclasses import field, replace
from pathlib import Path

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note
from viewer.errors import RenderError, RigError
from viewer.exporters._exporter import Part, Selection
from viewer.exporters._gaps import filled, kept_gaps, kept_note
from viewer.exporters._left_out import motion_notes, of_figure
from viewer.exporters._losses.largest_distances import REGULAR, evenly
from viewer.exporters._losses.pose_errors import PoseLosses
from viewer.exporters._options import ExportOptions
from viewer.exporters.gltf.document import text_of
from viewer.exporters.html.figures import is_lit, pack_mesh, pack_skin, pack_studio, plain
from viewer.exporters.html.motion import Tracks, pack_dofs, pack_tracks, size_of, tracks_of
from viewer.exporters.html.packing import Packer, unpacked
from viewer.formats import save_text
from viewer.phrases import counted, file_size, listed
from viewer.progress import report
from viewer.rendering.camera import facing_camera, fit
from viewer.rendering.colors import colormap
from viewer.rendering.gpu.studio import STUDIO_SAMPLERS
from viewer.rendering.gpu.surfaces import SAMPLERS
from viewer.rendering.lighting import SHADOW_STRENGTH
from viewer.rendering.options import DisplayOptions, Lights
from viewer.rendering.passes.background_pass import GRADIENT
from viewer.rendering.passes.ground_pass import LINE_COLOR, grid_of
from viewer.rendering.passes.mesh_pass import SKIN_COLOR
from viewer.rendering.passes.shadow_passes import GRAZING, SHADOW_OPACITY
from viewer.rendering.shader_text import embedded_text
from viewer.rendering.view import FILTER_RADIUS, light_uniforms, view_of
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.file_record import Json
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.inspection.front import guess_front
from viewer.rigs.mesh import bounding_box
from viewer.rigs.motion.evaluation import pose_of
from viewer.rigs.pose import Pose
from viewer.rigs.scene import Actor, Scene, actor_points
from viewer.rigs.skinning import Skinning, skinned
from viewer.rigs.srgb import decode_srgb

_FOLDER = Path(__file__).resolve().parent
_SCRIPTS = (
    *("decode", "joints", "tracks", "drawing", "figure", "ground", "camera"),
    *("panels", "messages", "page"),
)
_SEEN = 9  # frames that the camera frames, at most
_POSTER = (800, 450)
# Ratios of width and height of which ``camera.js`` knows the distances that fit: 1 : 2 to 2 : 1.
_ASPECTS = 2.0 ** np.linspace(-1.0, 1.0, 13)


def export(selection: Selection, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write figures in their poses or with their frames, placed as in their scene."""
    count, page_options = len(selection.parts), options.page
    if page_options.wipes and count < 2:
        raise RigError(f"divider of pages: expected at least 2 figures, found {count}")
    packer, shown = Packer(), list[_Shown]()
    first = min((each.start for each in selection.parts if each.frames is not None), default=0.0)
    for number, part in enumerate(selection.parts):
        report(number, count, "figures")
        shown.append(_shown(part, options, first))
        if page_options.wipes and number:
            together = part.actor.placement.copy()
            together[:3, 3] = selection.parts[0].actor.placement[:3, 3]
            shown[-1] = replace(shown[-1], actor=replace(part.actor, placement=together))
    how, texts = options.skinning, list[str]()
    packed = [each.pack(how, packer, texts) for each in shown]
    scene = selection.scene or Scene(selection.actors)
    points = np.concatenate([each.points for each in shown])
    ramp = decode_srgb(colormap()[:, :3] / 255.0)
    header: Json = {
        **_stage(scene, points),
        "ramp": packer.add(ramp, 2.0**-12),
        "samplers": {**SAMPLERS, **STUDIO_SAMPLERS},
        "title": path.stem,
        "wipes": page_options.wipes,
        "figures": [figure for figure, _ in packed],
        "programs": _programs([figure for figure, _ in packed]),
        "items": packer.items,
    }
    if any(is_lit(figure) for figure, _ in packed):
        header["studio"] = pack_studio(packer)
    data = packer.text()
    poster = _poster(scene, shown[:1] if page_options.wipes else shown)
    page = _page(header, data, poster, _description(shown), page_options.caption)
    save_text(path, page)
    arrays = unpacked(packer.items, data)
    notes = list[Diagnostic]()
    for one, (figure, center) in zip(shown, packed, strict=True):
        own = one.notes + one.losses(path, figure, center, arrays, how)
        notes += own if len(shown) == 1 else [of_figure(one.actor, each) for each in own]
    seconds = max(each.start + (len(each.poses) - 1) / each.rate for each in shown)
    values = {
        "figures": listed([each.actor.name for each in shown]),
        "n": counted(max(len(each.poses) for each in shown), "frame"),
        "seconds": f"{seconds:.4g}",
        "size": file_size(len(page.encode())),
    }
    written = note("X001.html: {figures}: {n}, {seconds} s, {size}", path, **values)
    remarks = [note("X005.page: {text}", text=text) for text in dict.fromkeys(texts)]
    return [written, *remarks, *notes]


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """One figure of the page."""

    actor: Actor
    poses: list[Pose | None]
    present: Bools
    rate: float
    start: float
    """Seconds from the start of the page's timeline."""
    tracks: Tracks
    holds: bool = True
    """Whether the figure is present before its first and after its last frame."""
    first_frame: int | None = None
    """Number of the first frame; None for a pose."""
    notes: list[Diagnostic] = field(default_factory=list)
    """What the page leaves out of the motion."""

    @property
    def seen(self) -> list[int]:
        """Some frames, evenly spread, in which the figure is present."""
        there = np.flatnonzero(self.present)
        chosen = np.linspace(0, len(there) - 1, min(_SEEN, len(there)))
        found: list[int] = there[np.round(chosen).astype(int)].tolist()
        return found

    @property
    def points(self) -> Floats:
        """The points (N, 3) of these frames, scene space."""
        return np.concatenate(
            [actor_points(replace(self.actor, own_pose=self.poses[frame])) for frame in self.seen]
        )

    def pack(self, how: Skinning, packer: Packer, notes: list[str]) -> tuple[Json, Floats]:
        """Add everything about the figure; return its members of the header and its centre."""
        actor, figure, rest = self.actor, self.actor.figure, self.tracks.rest
        packed: Json = {
            "name": actor.name,
            "placement": actor.placement.T.reshape(-1).tolist(),
            "color": list(actor.color or SKIN_COLOR),
            "opacity": actor.opacity,
            "size": size_of(rest),
            "motion": {
                **pack_tracks(self.tracks, packer),
                "rate": self.rate,
                "start": self.start,
                "holds": self.holds,
            },
        }
        if not self.present.all():
            packed["motion"]["present"] = packer.add(self.present)
        center = np.zeros(3)
        if figure.skeleton is not None:
            packed["joints"] = {
                "names": list(figure.skeleton.names),
                "parents": figure.skeleton.parents.tolist(),
                **pack_dofs(self.tracks, self.poses[0], packer),
            }
        if figure.mesh is not None and figure.mesh.n_vertices:
            packed["mesh"], center = pack_mesh(self.tracks, actor.hidden_parts, packer, notes)
            if figure.is_attached:
                packed["skin"] = pack_skin(rest.require_skin(), how, packer)
                packed["skin"]["isAffine"] = "stretches" in packed["motion"]
        return packed, center

    def losses(
        self, path: Path, packed: Json, center: Floats, arrays: Sequence[Floats], how: Skinning
    ) -> list[Diagnostic]:
        """Return a note about the largest errors of the numbers in the file."""
        losses, frames = PoseLosses(self.actor.figure, how), np.flatnonzero(self.present)
        skinned = set(evenly(len(frames), REGULAR).tolist()) if "mesh" in packed else set()
        for row, frame in enumerate(frames.tolist()):
            report(row, len(frames), "frames", "comparing with the original")
            vertices = None
            if row in skinned:
                vertices = _unpacked_vertices(packed, center, arrays, frame, self.tracks, how)
            joints = _unpacked_joints(packed["motion"], arrays, frame)
            losses.look(self.poses[frame], vertices, joints, frame=frame)
        return losses.notes(path, self.first_frame)


def _unpacked_vertices(
    packed: Json,
    center: Floats,
    arrays: Sequence[Floats],
    frame: int,
    tracks: Tracks,
    how: Skinning,
) -> Floats:
    """Return the vertices (V, 3) that the numbers of a page mean in a frame, in float64."""
    motion, mesh = packed["motion"], tracks.rest.require_mesh()
    rest = arrays[packed["mesh"]["positions"]] + center
    if "fields" in motion:
        fields = arrays[motion["fields"]].reshape(len(rest), -1, 3)
        rest = rest + np.einsum("k,vkc->vc", arrays[motion["weights"]][frame], fields)
    moved = rest
    if "skin" in packed:
        skin = tracks.rest.require_skin()
        binds = np.array(packed["skin"]["binds"]).reshape(-1, 3)
        turns = arrays[motion["rotations"]][frame].reshape(-1, 4)
        linear = quaternion_to_matrix(turns / np.linalg.norm(turns, axis=1, keepdims=True))
        if "stretches" in motion:
            upper = arrays[motion["stretches"]][frame].reshape(-1, 6)
            linear = linear @ upper[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
        palette = np.tile(np.eye(4), (len(binds), 1, 1))
        palette[:, :3, :3] = linear
        palette[:, :3, 3] = arrays[motion["places"]][frame].reshape(-1, 3)
        palette[:, :3, 3] -= np.einsum("jab,jb->ja", linear, binds)
        moved = skinned(mesh, skin, rest, palette, how)[0]
    return _in_figure(moved, motion, arrays, frame)


def _unpacked_joints(motion: Json, arrays: Sequence[Floats], frame: int) -> Floats | None:
    """Return the places (J, 3) of joints that the numbers of a page mean in a frame, if any."""
    track = motion.get("joints", motion.get("places"))
    if track is None:
        return None
    return _in_figure(arrays[track][frame].reshape(-1, 3), motion, arrays, frame)


def _in_figure(points: Floats, motion: Json, arrays: Sequence[Floats], frame: int) -> Floats:
    """Return points (N, 3) in the space of the figure, which its root scales and moves."""
    model = arrays[motion["model"]][frame]
    return model[3] * points + model[:3]


def _shown(part: Part, options: ExportOptions, first: float) -> _Shown:
    """Return a part as it is shown; the page begins at ``first``."""
    for what, value in (("unit", options.unit), ("up axis", options.up)):
        if value:
            raise RigError(f"{what} of pages: expected none, as the scene is shown, found {value}")
    actor = part.actor
    if part.frames is None:
        still = tracks_of(actor.figure, [actor.own_pose], options.skinning)
        return _Shown(actor, [actor.own_pose], np.ones(1, np.bool_), 1.0, 0.0, still)
    animation = part.animation
    if options.gaps == "split":
        raise RigError('gaps of pages: expected hold or interpolate, found "split"')
    number = animation.first_frame
    kept, notes = kept_gaps(animation.frames, options.gaps, number)
    frames = filled(kept, interpolate=False)
    poses = [pose_of(animation.figure, frames, frame) for frame in range(frames.n_frames)]
    tracks = tracks_of(animation.figure, poses, options.skinning)
    timing = animation.motion.timing
    holds = timing is None or timing.holds
    rate, start = animation.frame_rate, part.start - first
    notes = [*notes, *kept_note(kept.present, number), *motion_notes(animation)]
    return _Shown(actor, [*poses], kept.present, rate, start, tracks, holds, number, notes)


def _stage(scene: Scene, points: Floats) -> Json:
    """Return the members of the header about camera, lights, ground and background."""
    camera, box = facing_camera(guess_front(scene), scene.up), bounding_box(points)
    distances = []
    for aspect in _ASPECTS.tolist():
        fit(camera, points, aspect)
        distances.append(camera.distance)
    lights = light_uniforms(view_of(camera, (1, 1), box), Lights())
    placement, values = grid_of(box, scene.up)
    grid = {**values, "u_line_color": LINE_COLOR}
    return {
        "up": scene.up,
        "box": box.tolist(),
        "camera": {
            "target": camera.target.tolist(),
            "distances": distances,
            "azimuth": camera.azimuth,
            "inclination": camera.inclination,
            "fov": camera.fov,
        },
        "lights": {name: plain(name, value) for name, value in lights.items()},
        "shadow": {
            "radius": FILTER_RADIUS,
            "strength": SHADOW_STRENGTH,
            "opacity": SHADOW_OPACITY,
            "grazing": list(GRAZING),
        },
        "background": {name: plain(name, value) for name, value in GRADIENT.items()},
        "ground": {
            "placement": placement.T.reshape(-1).tolist(),
            "uniforms": {name: plain(name, value) for name, value in grid.items()},
        },
    }


def _programs(figures: Sequence[Json]) -> Json:
    """Return the texts of the shaders that some figures need, by name: vertex and fragment."""
    found: Json = {
        "background": [embedded_text("fullscreen.vert"), embedded_text("background.frag")],
        "ground": [embedded_text("ground.vert"), embedded_text("ground.frag")],
        "patch": [embedded_text("patch.vert"), embedded_text("ground_shadow.frag")],
        "lines": [embedded_text("edge.vert"), embedded_text("line.frag")],
    }
    for mesh in [figure["mesh"] for figure in figures if "mesh" in figure]:
        macros = ("MATERIALS",) * mesh["hasMaterials"]
        vertex = embedded_text("mesh.vert", "", macros)
        # The colours of weights are lit as surfaces without metalness and roughness.
        for shading in ("phong", mesh["shading"]):
            surface = embedded_text("mesh.frag", shading, (*macros, "SHADOWS"))
            found["-".join(("mesh", shading, *macros))] = [vertex, surface]
        found["-".join(("depth", *macros))] = [vertex, embedded_text("depth.frag", "", macros)]
        if mesh["shading"] == "pbr" and any("outline" in each for each in mesh["surfaces"]):
            surface = embedded_text("mesh.frag", "pbr", (*macros, "SHADOWS", "HULL"))
            found["hull"] = [embedded_text("hull.vert", "", macros), surface]
    for skin in [figure["skin"] for figure in figures if "skin" in figure]:
        affine = ("AFFINE_PALETTE",) * skin["isAffine"]
        text = embedded_text("skin.vert", skin["method"], affine)
        found["-".join(("skin", skin["method"], *affine))] = [text, _NOTHING]
    return found


_NOTHING = "#version 300 es\nvoid main() {}\n"  # WebGL programs need both shaders


def _poster(scene: Scene, shown: Sequence[_Shown]) -> str:
    """Return a picture of the first frame as a data address; empty without usable OpenGL."""
    from viewer.media.image import encoded_image
    from viewer.rendering.offscreen import render

    actors = [
        replace(each.actor, own_pose=each.poses[0], is_present=bool(each.present[0]))
        for each in shown
    ]
    try:
        pixels = render(
            replace(scene, actors=actors), _POSTER, None, DisplayOptions(quality="normal")
        )
    except RenderError:
        return ""
    data = encoded_image(Path("poster.jpg"), pixels)
    return f"data:image/jpeg;base64,{base64.b64encode(data).decode('ascii')}"


def _description(shown: Sequence[_Shown]) -> str:
    """Return the text for those who cannot see the picture."""
    n_frames = max(len(each.poses) for each in shown)
    names = ", ".join(each.actor.name for each in shown)
    return f"{names}: 3D view, {n_frames} frames" if n_frames > 1 else f"{names}: 3D view"


def _page(header: Json, data: str, poster: str, description: str, caption: str) -> str:
    """Return the text of the page."""
    style = (_FOLDER / "page.css").read_text("utf-8")
    script = "\n".join((_FOLDER / f"{name}.js").read_text("utf-8") for name in _SCRIPTS)
    script = f"\n(() => {{\n{script}\n}})();\n"
    # In a script element, only "<" could end the data or begin a comment.
    text = json.dumps(header, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    policy = (
        "default-src 'none'; img-src data:; "
        f"script-src {_hash_of(script)}; style-src {_hash_of(style)}"
    )
    page = (_FOLDER / "page.html").read_text("utf-8")
    picture = f'<img id="poster" alt="{_escaped(description)}" src="{poster}">' if poster else ""
    parts = {
        "policy": policy,
        "title": _escaped(header["title"]),
        "description": _escaped(description),
        "style": style,
        "poster": picture,
        "caption": _escaped(caption),
        "header": text,
        "data": data,
        "script": script,
    }
    # The marks are split off first, since contents may look like one.
    pieces = page.split("{{")
    return pieces[0] + "".join(
        parts[name] + rest for name, rest in (piece.split("}}", 1) for piece in pieces[1:])
    )


def _escaped(text: str) -> str:
    return html.escape(text_of(text))


def _hash_of(text: str) -> str:
    """Return the source of a content security policy that permits one inline text."""
    digest = hashlib.sha256(text.encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"
