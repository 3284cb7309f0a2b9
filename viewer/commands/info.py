"""Description of files: joints, DOFs, limits, vertices, triangles, influences, warnings.

``describe`` collects everything as JSON data; the printed lines are made from that data, so both
say the same.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from viewer.commands._pose import add_skinning_arguments, use_file_method
from viewer.commands._scene import (
    add_scene_arguments,
    open_scene,
    print_warnings,
    scene_options,
)
from viewer.commands._settings import settings_of, stated
from viewer.commands._usage import require_files
from viewer.diagnostics import described
from viewer.diagnostics.record import JsonObject, finite, note_values
from viewer.phrases import counted, listed, printable, rounded
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.mesh import Mesh, bounding_box, box_size, flat_triangles
from viewer.rigs.number_text import number_text
from viewer.rigs.pose import Pose, rest_pose
from viewer.rigs.scene import Actor, Scene, actor_points, scene_unit
from viewer.rigs.shape import shaped
from viewer.rigs.skeleton import (
    DOF_KINDS,
    Skeleton,
    joint_labels,
    shown_joints,
    shown_parents,
)
from viewer.rigs.skinning import METHODS, PURE, Skinning, joint_matrices

if TYPE_CHECKING:
    from viewer.rigs.blendshapes import BlendShapes
    from viewer.rigs.material import Material
    from viewer.rigs.skin import Skin

# If more unlimited DOFs than this differ from 0, only their number is printed.
_MOST_FREE_DOFS = 24
_BOX_DIGITS = 4  # digits of a size; those of the corners of a box have the same precision
_LIMITS = (4, 8)  # influences per vertex in common engines


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.usage = "%(prog)s FILES ... [options]"
    add_scene_arguments(parser, default="")
    add_skinning_arguments(parser)
    parser.add_argument(
        "--joints",
        action="store_true",
        help="also print all joints: index, name, parent, and position in the scene as posed",
    )
    parser.add_argument("--json", action="store_true", help="print everything as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Print the contents of the files."""
    require_files(arguments.files, arguments.body, "info")
    skinning = settings_of(Skinning, arguments)
    scene = open_scene(scene_options(arguments))
    print_warnings(use_file_method(scene, skinning, stated(Skinning, arguments)))
    found = describe(scene, skinning)
    note_values(found)
    if arguments.json:
        import json

        print(json.dumps(found, indent=1, allow_nan=False))
    else:
        for actor, parts in zip(scene.actors, found["actors"], strict=True):
            print("\n".join(_lines(parts) + _model_lines(parts["model"], actor.figure)))
            if arguments.joints and "skeleton" in parts:
                print("\n".join(_joint_lines(parts["skeleton"]["joint_table"], parts["size"])))
        for heading, text in found["captures"]:
            print(f"{heading}: {text}")
        if found["cameras"]:
            print(f"{counted(len(found['cameras']), 'camera')}: {listed(found['cameras'])}")
    return 0


def describe(scene: Scene, skinning: Skinning | None = None) -> JsonObject:
    """Return the contents of a scene as JSON data; lengths in figure units, angles in radians."""
    how = skinning or Skinning()
    return {
        "schema": "info/1",
        "actors": [
            _describe_actor(actor, scene.up) | {"model": _describe_model(actor, how)}
            for actor in scene.actors
        ],
        "captures": [[heading, text] for heading, text in scene.facts],
        "cameras": [printable(view.name) for view in scene.views],
        "warnings": list(scene.warnings),
        "diagnostics": [described(found) for found in scene.diagnostics],
    }


def _describe_actor(actor: Actor, up: Up) -> JsonObject:
    """Return the description of an actor; its box is in world space, with up axis ``up``."""
    figure = actor.figure
    points = actor_points(actor) if actor.is_present else np.zeros((0, 3))
    box = bounding_box(points) if len(points) else None
    parts: JsonObject = {"name": actor.name, "up": up, "present": actor.is_present}
    parts["figure"] = figure.name
    parts |= {"box": None if box is None else box.tolist()}
    parts |= {"size": None if box is None else box_size(box), "attached": figure.is_attached}
    parts["unit"] = scene_unit(Scene([actor])) or None
    if figure.skeleton is not None and actor.own_pose is not None:
        places = joint_matrices(figure, actor.own_pose)[:, :3, 3]
        parts["skeleton"] = _describe_skeleton(
            figure.skeleton,
            actor.own_pose.dofs.tolist(),
            apply_transform(actor.placement, places).tolist(),
        )
    if figure.mesh is not None:
        parts["mesh"] = _describe_mesh(figure.mesh)
    if figure.skin is not None:
        parts["skin"] = _describe_skin(figure.skin, figure.skeleton)
    if figure.blend_shapes is not None:
        from viewer.rigs.morph_target import MORPH_GROUP

        if MORPH_GROUP in figure.blend_shapes.groups:
            parts["morphs"] = _describe_morphs(figure.blend_shapes)
    if actor.clip is not None or figure.animations:
        from viewer.commands._info_clips import describe_animations, describe_clip

        if actor.clip is not None:
            parts["clip"], space = describe_clip(actor.clip), actor.shape_space
            parts["clip"] |= {"model": space.model or None, "gender": space.gender or None}
        if figure.animations:
            parts["animations"] = describe_animations(actor)
    return parts


def _describe_skeleton(
    skeleton: Skeleton, dofs: list[float], positions: list[list[float]]
) -> JsonObject:
    """Return the description of a skeleton in a pose; ``positions``: of its joints, scene space."""
    labels, shown = joint_labels(skeleton), shown_joints(skeleton).tolist()
    names, parents = skeleton.names, shown_parents(skeleton)
    limits = skeleton.dof_limits
    return {
        "joints": len(shown),
        "roots": int((skeleton.parents < 0).sum()),
        "dofs": skeleton.n_dofs,
        "locked_dofs": int(skeleton.locked.sum()),
        "limited_dofs": int(np.isfinite(limits).any(axis=1).sum()),
        "joint_table": [
            {
                "index": joint,
                "name": printable(names[joint]),
                "label": labels[joint],
                "parent": int(parents[joint]),
                "position": positions[joint],
            }
            for joint in shown
        ],
        "dof_table": [
            {
                "name": f"{labels[joint]}.{DOF_KINDS[kind]}",
                "value": value,
                "minimum": finite(low),
                "maximum": finite(high),
            }
            for joint, kind, value, (low, high) in zip(
                skeleton.dof_joints, skeleton.dof_kinds, dofs, limits.tolist(), strict=True
            )
        ],
    }


def _describe_mesh(mesh: Mesh) -> JsonObject:
    lengths = np.linalg.norm(mesh.normals, axis=1)
    # Triangles without a part are counted first.
    counts = np.bincount(mesh.part_indices + 1, minlength=len(mesh.parts) + 1)[1:]
    return {
        "vertices": mesh.n_vertices,
        "triangles": mesh.n_triangles,
        "degenerate_triangles": int(flat_triangles(mesh).sum()),
        "unused_vertices": int(mesh.n_vertices - len(np.unique(mesh.triangles))),
        "normal_lengths": [float(lengths.min()), float(lengths.max())],
        "has_uvs": mesh.uvs is not None,
        "has_colors": mesh.colors is not None,
        "parts": [
            {"name": name, "triangles": int(count)}
            for name, count in zip(mesh.parts, counts, strict=True)
        ],
        "materials": [
            {
                "name": material.name,
                "texture": material.texture,
                "pixels": None if material.image is None else list(material.image.shape[1::-1]),
                **_describe_surface(material),
            }
            for material in mesh.materials
        ],
    }


def _describe_skin(skin: Skin, skeleton: Skeleton | None) -> JsonObject:
    from viewer.rigs.skin import has_influence, idle_joints, influence_counts, weight_sums

    counts = influence_counts(skin)
    sums = weight_sums(skin)
    moved = has_influence(skin)
    return {
        "bindings": skin.n_joints,
        "influences": len(skin.joints),
        "influence_histogram": {
            str(count): int(number) for count, number in enumerate(np.bincount(counts)) if number
        },
        "mean_influences": float(counts.mean()),
        "weight_sums": [float(sums[moved].min()), float(sums[moved].max())] if moved.any() else [],
        "zero_weights": int((skin.weights == 0.0).sum()),
        "negative_weights": int((skin.weights < 0.0).sum()),
        "vertices_without_influence": int((~moved).sum()),
        "joints_without_vertices": idle_joints(skin, skeleton).tolist(),
    }


def _describe_morphs(shapes: BlendShapes) -> list[JsonObject]:
    """Return the morph targets with the numbers of vertices and materials that each changes."""
    from viewer.rigs.morph_target import MORPH_GROUP

    rows = [row for row, group in enumerate(shapes.groups) if group == MORPH_GROUP]
    counts = shapes.direction_values()[rows].any(axis=2).sum(axis=1)
    binds = shapes.material_binds
    materials = {} if binds is None else binds.n_materials
    return [
        {"name": shapes.names[row], "vertices": int(count), "materials": materials.get(row, 0)}
        for row, count in zip(rows, counts, strict=True)
    ]


def _morph_line(morph: JsonObject) -> str:
    vertices = counted(morph["vertices"], "vertex")
    changes = f", changes {counted(morph['materials'], 'material')}" if morph["materials"] else ""
    return f"  morph      {printable(morph['name'])}: moves {vertices}{changes}"


def _lines(actor: JsonObject) -> list[str]:
    lines = [f"{printable(actor['name'])}", f"  box        {_box_text(actor)}, {actor['up']} up"]
    if actor["figure"] not in actor["name"]:
        lines.append(f"  figure     {printable(actor['figure'])}")
    if "skeleton" in actor:
        lines += _skeleton_lines(actor["skeleton"])
    if "mesh" in actor:
        lines += _mesh_lines(actor["mesh"])
    if "skin" in actor:
        lines += _skin_lines(actor["skin"])
    lines += [_morph_line(morph) for morph in actor.get("morphs", [])]
    if "clip" in actor or "animations" in actor:
        from viewer.commands._info_clips import animation_lines, clip_lines

        lines += clip_lines(actor["clip"]) if "clip" in actor else []
        lines += animation_lines(actor["animations"]) if "animations" in actor else []
    return lines


def _box_text(actor: JsonObject) -> str:
    if actor["box"] is None:
        return "none: nothing is visible" if actor["present"] else "none: absent at this time"
    low, high = actor["box"]
    unit = f" {actor['unit']}" if actor["unit"] else ""
    size = actor["size"]
    finest = _finest(size)
    points = _point(low, finest), _point(high, finest)
    return f"{points[0]} to {points[1]}, size {rounded(size, _BOX_DIGITS)}{unit}"


def _finest(size: float) -> float:
    """Return the power of ten to which points of a box are rounded; 0 for all digits."""
    # Far from the origin, the corners of a small box have more digits.
    return 10.0 ** (1 - _BOX_DIGITS + math.floor(math.log10(size))) if size > 0.0 else 0.0


def _skeleton_lines(skeleton: JsonObject) -> list[str]:
    table = skeleton["dof_table"]
    lines = [
        f"  skeleton   {counted(skeleton['joints'], 'joint')}, {counted(skeleton['dofs'], 'DOF')} "
        f"({skeleton['limited_dofs']} limited, {skeleton['locked_dofs']} of them locked)"
    ]
    # The many ball joints of glTF, FBX and BVH would hide everything else.
    too_many = sum(_is_free(dof) and dof["value"] != 0.0 for dof in table) > _MOST_FREE_DOFS
    listed_dofs = [dof for dof in table if not _is_free(dof) or (dof["value"] and not too_many)]
    lines += [_dof_line(dof) for dof in listed_dofs]
    if left_out := len(table) - len(listed_dofs):
        more = "more " if listed_dofs else ""
        kind = "unlimited" if too_many else "0 and unlimited"
        lines.append(f"    {left_out} {more}are {kind} (--json lists all)")
    return lines


def _joint_lines(joints: list[JsonObject], size: float | None) -> list[str]:
    """Return a table of the joints, with positions as precise as the corners of the box."""
    from viewer.commands._printing import table_lines

    label = {joint["index"]: printable(joint["label"]) for joint in joints}
    finest = _finest(size or 0.0)
    rows = [["joint", "name", "parent", "position"]]
    rows += [
        [
            str(joint["index"]),
            label[joint["index"]],
            label.get(joint["parent"], ""),
            _point(joint["position"], finest),
        ]
        for joint in joints
    ]
    return [f"    {line}" for line in table_lines(rows, right=[0])]


def _is_free(dof: JsonObject) -> bool:
    return dof["minimum"] is None and dof["maximum"] is None


def _dof_line(dof: JsonObject) -> str:
    low, high = dof["minimum"], dof["maximum"]
    limits = "unlimited" if low is None and high is None else f"{_bound(low)} to {_bound(high)}"
    if low is not None and low == high:
        limits = "locked"
    return f"    {printable(dof['name']):<24} {number_text(dof['value'], '>10.6g')}  {limits}"


def _bound(value: float | None) -> str:
    return "unlimited" if value is None else number_text(value, ".6g")


def _mesh_lines(mesh: JsonObject) -> list[str]:
    lines = [
        f"  mesh       {counted(mesh['vertices'], 'vertex')}, "
        f"{counted(mesh['triangles'], 'triangle')} "
        f"({mesh['degenerate_triangles']} degenerate), "
        f"{'with' if mesh['has_uvs'] else 'without'} texture coordinates"
    ]
    if mesh["has_colors"]:
        lines[0] += ", with vertex colours"
    if len(mesh["parts"]) > 1:
        names = listed([printable(part["name"] or "without a name") for part in mesh["parts"]])
        lines.append(f"    {counted(len(mesh['parts']), 'part')}: {names} (--hide-part hides them)")
    for material in mesh["materials"]:
        pixels = material["pixels"]
        state = f"{pixels[0]} x {pixels[1]} pixels" if pixels else "not drawn"
        name = printable(material["name"] or "without a name")
        picture = [f"{printable(material['texture'])}, {state}"] if material["texture"] else []
        shown = "; ".join([*picture, *_surface_words(material)]) or "no picture"
        lines.append(f"    material {name}: {shown}")
    return lines


def _skin_lines(skin: JsonObject) -> list[str]:
    histogram = "  ".join(f"{k}: {n}" for k, n in skin["influence_histogram"].items())
    sums = skin["weight_sums"]
    lines = [
        f"  skin       {skin['bindings']} bindings, {skin['influences']} influences, "
        f"mean {skin['mean_influences']:.3g} per vertex",
        f"    vertices by number of influences   {histogram}",
    ]
    if sums:
        lines.append(
            f"    weight sums {number_text(sums[0], '.6g')} to {number_text(sums[1], '.6g')}"
        )
    for key, text in (
        ("zero_weights", "weights are 0"),
        ("negative_weights", "weights are negative"),
        ("vertices_without_influence", "vertices have no influence"),
    ):
        if skin[key]:
            lines.append(f"    {skin[key]} {text}")
    if skin["joints_without_vertices"]:
        idle = counted(len(skin["joints_without_vertices"]), "joint", "has", "have")
        lines.append(f"    {idle} no influence")
    return lines


def _point(values: list[float], finest: float) -> str:
    """Return coordinates as text, rounded to multiples of ``finest``, a power of ten."""
    rows = [value if finest == 0.0 else finest * round(value / finest) for value in values]
    return f"({', '.join(number_text(row, '.10g') for row in rows)})"


def _describe_model(actor: Actor, skinning: Skinning) -> JsonObject:
    """Return the properties of a shaped and posed body as JSON data; empty for a plain rig."""
    figure, pose = actor.figure, actor.own_pose
    facts = {heading: str(fact) for heading, fact in figure.facts}
    model: JsonObject = {"facts": facts} if facts else {}
    if figure.blend_shapes is not None:
        shapes = figure.blend_shapes
        model["shapes"] = [
            {"name": name, "group": group}
            for name, group in zip(shapes.names, shapes.groups, strict=True)
        ]
    if figure.mesh is not None and figure.unit == "m":
        model["rest"] = _rest(figure, pose)
    if pose is not None:
        model |= {
            "shape_weights": pose.shape_weights.tolist(),
            "figure_translation": pose.figure_translation.tolist(),
            "figure_scale": pose.figure_scale,
        }
        if figure.pose_layout is not None and figure.skeleton is not None:
            from viewer.rigs.posing.pose_vector import write_vector

            numbers = write_vector(figure.pose_layout, figure.skeleton, pose)
            model["own_numbers"] = numbers.tolist()
    model |= _annotations(figure)
    model["effects"] = _effects(figure, pose, skinning)
    return model


def _rest(figure: Figure, pose: Pose | None) -> JsonObject:
    from viewer.rigs.inspection.measure import measure
    from viewer.rigs.skinning import deform

    rest = figure if pose is None else shaped(figure, pose.shape_weights)
    skeleton, mesh = figure.skeleton, figure.mesh
    # A body model is at rest as it was modelled. The joints of other figures may be elsewhere at
    # rest than where they were when the skin was attached, or be scaled.
    if mesh is not None and skeleton is not None and figure.is_attached and not figure.pose_layout:
        still = rest_pose(skeleton)
        if pose is not None:
            still.shape_weights = pose.shape_weights
        positions, _ = deform(figure, still)
        rest = replace(rest, mesh=replace(rest.mesh or mesh, positions=positions))
    found = measure(rest)
    return {"height": found.height, "volume": found.volume, "mass": found.mass}


def _annotations(figure: Figure) -> JsonObject:
    parts: JsonObject = {}
    if figure.body_parts is not None:
        names = figure.body_parts.names
        counts = np.bincount(figure.body_parts.of_vertex, minlength=len(names))
        parts["body_parts"] = dict(zip(names, counts.tolist(), strict=True))
    if figure.keypoints is not None:
        parts["keypoints"] = list(figure.keypoints.names)
    if figure.reduced is not None:
        parts["reduced"] = {
            "vertices": len(figure.reduced.vertices),
            "triangles": len(figure.reduced.triangles),
        }
    if figure.symmetry is not None:
        from viewer.rigs.retargeting.mirror import asymmetry

        parts["asymmetry"] = float(asymmetry(figure).max())
    return parts


def _effects(figure: Figure, pose: Pose | None, skinning: Skinning) -> dict[str, float]:
    """Return the largest difference between skinning options in this pose, for each option."""
    if not figure.is_attached or pose is None:
        return {}
    from viewer.rigs.scalars import compute, strongest

    effects: dict[str, float] = {}
    for count in sorted({*_LIMITS, skinning.max_influences} - {0}):
        if strongest(figure) > count:
            pruned = Skinning(max_influences=count, correctives=skinning.correctives)
            largest = float(compute("pruning", figure, pose, pruned).max())
            effects[f"pruned to {count} influences"] = largest
    for name, text in (("normalized", "normalised weights"), ("correctives", "pose correctives")):
        effects[text] = float(compute(name, figure, pose, skinning).max())
    first, *others = (METHODS[name].short for name in PURE)
    effects[f"{' or '.join(others)} against {first}"] = float(
        compute("methods", figure, pose, skinning).max()
    )
    return {text: value for text, value in effects.items() if value > 0.0}


def _model_lines(model: JsonObject, figure: Figure) -> list[str]:
    """Return the description as lines of text."""
    lines = [
        f"  {name:<10} {printable(text, 400)}" for name, text in model.get("facts", {}).items()
    ]
    if "rest" in model:
        rest = model["rest"]
        solid = "open mesh without a volume"
        if rest["volume"] is not None:
            litres = 1000.0 * rest["volume"]
            solid = f"{litres:.2f} litres" if litres < 1000.0 else f"{rounded(rest['volume'])} m3"
            # The density of people says nothing about other figures.
            if figure.pose_layout is not None:
                solid += f", {rest['mass']:,.1f} kg at 985 kg/m3"
        lines.append(f"  rest       {rest['height']:.3f} m high, {solid}")
    if any(model.get("shape_weights", [])):
        weights = ", ".join(number_text(weight) for weight in model["shape_weights"])
        lines.append(f"  shape      {weights}")
    if "body_parts" in model:
        counts = ", ".join(f"{printable(n)} {c}" for n, c in model["body_parts"].items())
        lines.append(f"  parts      {counts}")
    if "reduced" in model:
        reduced = model["reduced"]
        lines.append(
            f"  reduced    {counted(reduced['vertices'], 'vertex')}, "
            f"{counted(reduced['triangles'], 'triangle')}"
        )
    if "keypoints" in model:
        lines.append(f"  keypoints  {len(model['keypoints'])}")
    if "asymmetry" in model:
        size = _length(figure, model["asymmetry"])
        lines.append(f"  symmetry   left and right differ by {size}")
    for text, value in model.get("effects", {}).items():
        lines.append(f"  effect     {text}: up to {_length(figure, value)} in this pose")
    return lines


def _length(figure: Figure, value: float) -> str:
    from viewer.rigs.scalars import length_text

    return length_text(figure, value)


def _describe_surface(material: Material) -> JsonObject:
    """Return the properties of a material other than one opaque texture."""
    if material.is_plain:
        return {}
    maps = {
        name.removesuffix("_texture"): texture.name
        for name, texture in material.textures.items()
        if name != "base_texture"
    }
    color = None if material.base_color is None else list(material.base_color)
    surface: JsonObject = {"base_color": color, "maps": maps, "alpha": material.alpha_mode}
    if material.is_physical:
        surface |= {"metallic": material.metallic, "roughness": material.roughness}
    if material.shade_color is not None:
        surface["toon"] = _describe_toon(material)
    return surface


def _describe_toon(material: Material) -> JsonObject:
    """Return the shade, rim light and outline of a toon material; None for what it lacks."""
    rim, outline = material.rim, material.outline
    toon: JsonObject = {
        "shade_color": None if material.shade_color is None else list(material.shade_color),
        "shade_range": list(material.shade_range),
        "rim": None,
        "outline": None,
    }
    if rim is not None and rim.has_effect:
        matcap = None if rim.matcap is None else rim.matcap.name
        toon["rim"] = {"color": list(rim.color), "power": rim.power, "matcap": matcap}
    if outline is not None:
        color = list(outline.color)
        toon["outline"] = {"mode": outline.mode, "width": outline.width, "color": color}
    return toon


def _surface_words(material: JsonObject) -> list[str]:
    """Return the properties of ``_describe_surface`` other than one texture, as text."""
    if "maps" not in material:
        return []
    words, toon = [], material.get("toon")
    if material["base_color"] is not None:
        words.append(f"colour {_numbers(material['base_color'])}")
    if toon is not None:
        words += _toon_words(toon)
    elif "metallic" in material:
        words.append(f"metallic {material['metallic']:.3g}, roughness {material['roughness']:.3g}")
    words += [f"{kind} {printable(file)}" for kind, file in material["maps"].items()]
    return words if material["alpha"] == "opaque" else [*words, f"alpha {material['alpha']}"]


def _toon_words(toon: JsonObject) -> list[str]:
    words = [f"toon with shade colour {_numbers(toon['shade_color'])}"]
    rim, outline = toon["rim"], toon["outline"]
    if rim is not None:
        matcap = f", matcap {printable(rim['matcap'])}" if rim["matcap"] else ""
        words.append(f"rim light {_numbers(rim['color'])}{matcap}")
    if outline is not None:
        on_screen = outline["mode"] == "screen"
        width = f"{100.0 * outline['width']:.3g} %" if on_screen else f"{outline['width']:.3g} m"
        of = " of the picture's height" if on_screen else ""
        words.append(f"outline {width}{of}, colour {_numbers(outline['color'])}")
    return words


def _numbers(values: list[float]) -> str:
    return " ".join(f"{value:.3g}" for value in values)
