"""Violations of the specification without visible effect, reported only by lint.

Those that Khronos' validator finds in the data of accessors, in skins, nodes and animations have
codes of their own; the others, of single members of the JSON, state what the specification expects.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeAlias

import numpy as np

from viewer.diagnostics import wording
from viewer.errors import FormatError
from viewer.formats._scene_graph.content import NodeMesh, NodeSkin, NodeTree
from viewer.formats._vrm.parts import list_in, objects_in, part
from viewer.formats.gltf.document import Document
from viewer.formats.gltf.elements import Element
from viewer.phrases import agree, counted, listed, printable, rounded
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.file_record import Json
from viewer.rigs.hierarchy import descendants, roots_of
from viewer.rigs.inspection.faults import UNIT_ROTATION

_ROUNDING = 1e-5  # tolerance of declared bounds, relative to the largest component
_NORMAL_ROUNDING = 5e-4  # tolerance of lengths and of the sign of tangents
_SHEAR = 1e-4  # tolerance of the cosines of the angles between the axes of a matrix
_LARGEST = 3.4028235e38  # largest number in single precision
_BYTE, _UBYTE, _SHORT, _USHORT, _UINT, _FLOAT = 5120, 5121, 5122, 5123, 5125, 5126

# Normalised integers that represent 1, by component type.
_ONES = {_BYTE: 127.0, _UBYTE: 255.0, _SHORT: 32767.0, _USHORT: 65535.0}
_FRACTIONS = ((_FLOAT, False), (_UBYTE, True), (_USHORT, True))

# Component types of each attribute, and whether they are normalised (glTF 2.0, 3.7.2.1).
_TYPES = {
    **dict.fromkeys(("POSITION", "NORMAL", "TANGENT"), ((_FLOAT, False),)),
    **dict.fromkeys(("TEXCOORD", "COLOR", "WEIGHTS"), _FRACTIONS),
    "JOINTS": ((_UBYTE, False), (_USHORT, False)),
}
_INDICES = (_UBYTE, _USHORT, _UINT)
_UNNORMALIZED = (_UINT, _FLOAT)  # component types that cannot be normalised

_KNOWN = re.compile(r"POSITION|NORMAL|TANGENT|(TEXCOORD|COLOR|JOINTS|WEIGHTS)_(0|[1-9]\d*)|_.*")
_MORPHED = re.compile(r"POSITION|NORMAL|TANGENT|(TEXCOORD|COLOR)_(0|[1-9]\d*)|_.*")

_VERTICES, _INDEX_TYPES = 34962, 34963
_TARGETS = {"vertex attributes": _VERTICES, "indices": _INDEX_TYPES}
_STRIDES = range(4, 253, 4)

_LISTS = (
    *("accessors", "animations", "buffers", "bufferViews", "cameras", "extensionsRequired"),
    *("extensionsUsed", "images", "materials", "meshes", "nodes", "samplers", "scenes", "skins"),
    "textures",
)

_Report: TypeAlias = Callable[[str, str, object, Sequence[str | int]], None]
"""Reports a key, what is expected, what is found, and the path to the member."""


def check_document(
    document: Document, tree: NodeTree, meshes: tuple[NodeMesh, ...], skins: tuple[NodeSkin, ...]
) -> None:
    """Record a warning for each violation; errors that reading reported are not repeated."""
    _check_bounds(document)
    _check_vertices(document)
    roots = roots_of(tree.parents)
    for index, skin in enumerate(skins):
        if len(skin.joints):
            _check_hierarchy(document.table("skins")[index], skin, tree.parents, roots)
    _check_nodes(document, tree, meshes)
    animations = document.table("animations")
    for index in range(len(animations)):
        try:
            _check_animation(document, animations[index])
        except FormatError:  # the error was reported when the item was read
            continue
    root = Element(document.source, {})

    def report(key: str, wanted: str, found: object, path: Sequence[str | int]) -> None:
        document.source.warn(key, root.at(*path), wanted=wanted, found=str(found))

    _check_storage(document.root.values, report)
    _check_primitives(document, report)
    _check_structure(document.root.values, tree, skins, report)


def _check_bounds(document: Document) -> None:
    """Compare declared bounds with the components of all accessors that have any."""
    for index in range(len(document.accessors)):
        try:
            accessor = document.accessors[index]
            if accessor.has("min") or accessor.has("max"):
                _compare_bounds(accessor, document.accessors.components(index))
        # The error was reported when the accessor was read, or the accessor is not used.
        except FormatError:
            continue


def _compare_bounds(accessor: Element, components: Floats | None) -> None:
    if components is None or not len(components) or not np.isfinite(components).all():
        return
    for name, found in (("min", components.min(axis=0)), ("max", components.max(axis=0))):
        if not accessor.has(name):
            continue
        declared = accessor.numbers(name)
        if declared is None or len(declared) != len(found):
            n_declared = 0 if declared is None else len(declared)
            accessor.warn(
                "G002.bounds-length: expected {expected}, one per component, found {found}",
                name,
                expected=counted(len(found), "number"),
                found=n_declared,
            )
            continue
        apart = np.abs(declared - found)
        if (apart > _ROUNDING * max(1e-30, float(np.abs(components).max()))).any():
            worst = int(apart.argmax())
            values = {
                "expected": rounded(float(found[worst]), 9),
                "found": rounded(float(declared[worst]), 9),
            }
            accessor.warn(
                "G002.bounds: component {component}: expected {expected} as in the data, found "
                "{found}",
                name,
                component=worst,
                **values,
            )


def _check_vertices(document: Document) -> None:
    """Check that positions have bounds, and that unused influences refer to joint 0."""
    table = document.table("meshes")
    for mesh in range(len(table)):
        try:
            primitives = table[mesh].table("primitives")
            for place in range(len(primitives)):
                attributes = primitives[place].part("attributes")
                if attributes is not None:
                    _check_attributes(document, attributes)
        except FormatError:  # the error was reported when the item was read
            continue


def _check_attributes(document: Document, attributes: Element) -> None:
    accessors = document.accessors
    position = attributes.index("POSITION", len(accessors), "accessors")
    if position >= 0 and not _has_bounds(accessors[position]):
        attributes.warn(
            "G002.no-bounds: positions: expected an accessor with min and max, found one without",
            "POSITION",
        )
    for name in attributes.values:
        number = name.removeprefix("JOINTS_")
        if number == name or not attributes.has(f"WEIGHTS_{number}"):
            continue
        joints = accessors.components(attributes.index(name, len(accessors), "accessors"))
        weights = accessors.components(
            attributes.index(f"WEIGHTS_{number}", len(accessors), "accessors")
        )
        if joints is None or weights is None or joints.shape != weights.shape:
            continue
        unused = (weights == 0.0) & (joints != 0.0)
        if unused.any():
            vertex = int(unused.any(axis=1).argmax())
            attributes.warn(
                "G009.unused-joints: {n} of weight 0 {refer} to a joint other than 0 (first: "
                "vertex {vertex})",
                name,
                n=counted(int(unused.sum()), "influence"),
                vertex=vertex,
                refer=agree(int(unused.sum()), "refers", "refer"),
            )


def _has_bounds(accessor: Element) -> bool:
    return accessor.has("min") and accessor.has("max")


def _check_hierarchy(skin: Element, read: NodeSkin, parents: Ints, roots: Ints) -> None:
    """Check that the joints have a common root, and that ``skeleton`` is one if it is declared."""
    found = np.unique(roots[read.joints]).tolist()
    if len(found) > 1:
        skin.warn(
            "G009.no-common-root: expected joints with a common root, found joints below nodes "
            "{nodes}",
            "joints",
            nodes=listed(found, 12),
        )
    declared = skin.values.get("skeleton")
    if type(declared) is int and 0 <= declared < len(parents):
        outside = int((~descendants(parents, declared)[read.joints]).sum())
        if outside:
            skin.warn(
                "G009.not-a-root: expected a common ancestor of all joints, found node {node}, "
                "with {n} outside its subtree",
                "skeleton",
                node=declared,
                n=counted(outside, "joint"),
            )


def _check_nodes(document: Document, tree: NodeTree, meshes: tuple[NodeMesh, ...]) -> None:
    """Check nodes with a mesh: skins without influences, influences without a skin."""
    n_bound = [sum(part.joints is not None for part in mesh.primitives) for mesh in meshes]
    is_drawn = [bool(mesh.primitives) for mesh in meshes]
    identity, unused = (0.0,) * 6 + (1.0,) * 4, []
    for node in np.flatnonzero(tree.meshes >= 0).tolist():
        mesh, element = int(tree.meshes[node]), document.table("nodes")[node]
        if tree.skins[node] < 0:
            if n_bound[mesh]:
                element.warn(
                    "G003.no-skin: mesh with joints and weights, but no skin: not deformed"
                )
            continue
        if is_drawn[mesh] and not n_bound[mesh]:
            element.warn(
                "G003.no-influences: skin of a mesh without joints and weights: not used", "skin"
            )
            continue
        local = (*tree.translations[node], *tree.rotations[node], *tree.scales[node])
        if node in tree.matrices or not np.allclose(local, identity, atol=1e-6):
            n_rigid = len(meshes[mesh].primitives) - n_bound[mesh]
            if n_rigid:
                element.warn(
                    "G003.partly-used: transform of a node with a skinned mesh: used only by its "
                    "{n} "
                    "without joints and weights",
                    n=counted(n_rigid, "primitive"),
                )
            else:
                unused.append(node)
    moved = np.flatnonzero((tree.skins >= 0) & (tree.parents >= 0)).tolist()
    for message, found in (
        (
            "G007.unused-transform: {n} with a skinned mesh {have} a transform, which is not used: "
            "{nodes}",
            unused,
        ),
        (
            "G007.skinned-child: {n} with a skinned mesh {are} below other nodes, whose transforms "
            "have no effect on {it}: {nodes}",
            moved,
        ),
    ):
        if found:
            table = document.table("nodes")
            table[found[0]].warn(
                message,
                n=counted(len(found), "node"),
                nodes=listed([_name(table[node].values, node) for node in found]),
                have=agree(len(found), "has", "have"),
                are=agree(len(found), "is", "are"),
                it=agree(len(found), "it", "them"),
            )


def _name(node: Json, index: int) -> str:
    """Return a node's name, or its number if it has none."""
    name = node.get("name")
    return printable(name, 60) if isinstance(name, str) and name else f"node {index}"


def _check_animation(document: Document, animation: Element) -> None:
    """Check times, bounds and rotations of keys, and that no channel moves a matrix."""
    channels, samplers = animation.table("channels"), animation.table("samplers")
    accessors, nodes = document.accessors, document.table("nodes")
    rotating: set[int] = set()
    for place in range(len(channels)):
        target = channels[place].part("target")
        if target is None:
            continue
        node = target.index("node", len(nodes), "nodes")
        path = target.text("path")
        if node >= 0 and path != "weights" and nodes[node].has("matrix"):
            target.warn(
                "G005.matrix: expected a node without a matrix, found node {node} with one: its "
                "matrix is decomposed",
                "node",
                node=node,
            )
        if path == "rotation":
            rotating.add(channels[place].index("sampler", len(samplers), "samplers"))
    seen: set[int] = set()
    for place in range(len(samplers)):
        sampler = samplers[place]
        times = sampler.index("input", len(accessors), "accessors")
        if times >= 0 and times not in seen:
            seen.add(times)
            _check_times(document, sampler, times)
        if place in rotating and sampler.text("interpolation", "LINEAR") != "CUBICSPLINE":
            _check_rotations(document, sampler)


def _check_times(document: Document, sampler: Element, accessor: int) -> None:
    if not _has_bounds(document.accessors[accessor]):
        sampler.warn(
            "G005.no-bounds: times: expected an accessor with min and max, found one without",
            "input",
        )
    times = document.accessors.components(accessor)
    if times is not None and len(times) and times.min() < 0.0:
        sampler.warn(
            "G005.negative: {n} at negative times (earliest: {found} s)",
            "input",
            n=counted(int((times < 0.0).sum()), "key"),
            found=rounded(float(times.min()), 6),
        )


def _check_rotations(document: Document, sampler: Element) -> None:
    accessor = sampler.index("output", len(document.accessors), "accessors")
    if accessor < 0:
        return
    keys = document.accessors.components(accessor)
    if keys is None or keys.shape[1] != 4:
        return
    one = _ONES.get(document.accessors[accessor].whole("componentType"), 1.0)
    lengths = np.linalg.norm(keys, axis=1) / one
    # Integers are rounded: 1 / 127 for each component of a byte.
    odd = np.abs(lengths - 1.0) > (UNIT_ROTATION if one == 1.0 else 0.02)
    if odd.any():
        key = int(odd.argmax())
        found = {"index": key, "found": rounded(float(lengths[key]), 6)}
        sampler.warn(
            "G005.unit: {n} not of unit length (first: {found}, key {index}): normalised",
            "output",
            n=counted(int(odd.sum()), "rotation"),
            **found,
        )


def _check_storage(root: Json, report: _Report) -> None:
    """Check all accessors and buffer views."""
    for index, accessor in objects_in(root, "accessors"):
        path, kind = ("accessors", index), accessor.get("componentType")
        if accessor.get("normalized") is True and kind in _UNNORMALIZED:
            wanted = "integers of 8 or 16 bits"
            report(wording.STORAGE, wanted, f"component type {kind}", (*path, "normalized"))
        if "byteOffset" in accessor and "bufferView" not in accessor:
            report(wording.STORAGE, "a bufferView", "none", (*path, "byteOffset"))
        for name in ("min", "max"):
            bounds = accessor.get(name)
            if isinstance(bounds, list) and not all(map(_is_number, bounds)):
                report(wording.STORAGE, "numbers", "other values", (*path, name))
            elif isinstance(bounds, list) and any(abs(each) > _LARGEST for each in bounds):
                found = max(bounds, key=abs)
                report(wording.STORAGE, "numbers in single precision", found, (*path, name))
    for index, view in objects_in(root, "bufferViews"):
        _check_view(root, view, index, report)
    _check_uses(root, report)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _check_view(root: Json, view: Json, index: int, report: _Report) -> None:
    path, target, stride = ("bufferViews", index), view.get("target"), view.get("byteStride")
    if target is not None and target not in _TARGETS.values():
        report(wording.STORAGE, "34962 or 34963", target, (*path, "target"))
    if stride is not None and stride not in _STRIDES:
        report(wording.STORAGE, "a multiple of 4 from 4 to 252", stride, (*path, "byteStride"))
    length, start, buffer = view.get("byteLength"), view.get("byteOffset", 0), view.get("buffer")
    buffers = root.get("buffers")
    if not isinstance(buffers, list) or not isinstance(buffer, int):
        return
    if not 0 <= buffer < len(buffers):
        return
    size = part(buffers[buffer], "byteLength")
    if isinstance(length, int) and isinstance(start, int) and isinstance(size, int):
        if length < 1:
            report(wording.STORAGE, "at least 1 byte", length, (*path, "byteLength"))
        elif start + length > size:
            wanted = f"an end within the {size} bytes of buffer {buffer}"
            report(wording.STORAGE, wanted, f"byte {start + length}", (*path, "byteLength"))


def _check_uses(root: Json, report: _Report) -> None:
    """Check that each view has one kind of content, and the target and stride of that kind."""
    accessors, views = dict(objects_in(root, "accessors")), dict(objects_in(root, "bufferViews"))
    first: dict[int, str] = {}
    told: set[tuple[int, str]] = set()
    for accessor, kind, path in _uses(root):
        index = accessors.get(accessor, {}).get("bufferView")
        if not isinstance(index, int) or index not in views or (index, kind) in told:
            continue
        view = views[index]
        told.add((index, kind))
        common = first.setdefault(index, kind)
        target = _TARGETS.get(kind)
        if common != kind:
            report(wording.STORAGE, f"a buffer view of {kind}", f"one of {common}", path)
        elif view.get("target") in _TARGETS.values() and view["target"] != target:
            found = f"target {view['target']}"
            report(wording.STORAGE, f"target {target}" if target else "no target", found, path)
        elif "byteStride" in view and target != _VERTICES:
            found = f"a stride of {view['byteStride']}"
            report(wording.STORAGE, f"{kind} without a stride", found, path)


def _uses(root: Json) -> Iterator[tuple[int, str, tuple[str | int, ...]]]:
    """Yield the accessors that are used, the kind of content, and the path to the reference."""
    given: list[tuple[object, str, tuple[str | int, ...]]] = []
    for m, mesh in objects_in(root, "meshes"):
        for p, primitive in objects_in(mesh, "primitives"):
            path: tuple[str | int, ...] = ("meshes", m, "primitives", p)
            given.append((primitive.get("indices"), "indices", (*path, "indices")))
            morphs = [(("targets", t), target) for t, target in objects_in(primitive, "targets")]
            for at, attributes in [(("attributes",), primitive.get("attributes")), *morphs]:
                for name, used in attributes.items() if isinstance(attributes, dict) else ():
                    given.append((used, "vertex attributes", (*path, *at, name)))
    for s, skin in objects_in(root, "skins"):
        used = skin.get("inverseBindMatrices")
        given.append((used, "inverse bind matrices", ("skins", s, "inverseBindMatrices")))
    for a, animation in objects_in(root, "animations"):
        for s, sampler in objects_in(animation, "samplers"):
            for name in ("input", "output"):
                path = ("animations", a, "samplers", s, name)
                given.append((sampler.get(name), "keys of animations", path))
    for used, kind, path in given:
        if isinstance(used, int):
            yield used, kind, path


def _check_primitives(document: Document, report: _Report) -> None:
    """Check the attributes of all primitives."""
    root = document.root.values
    accessors, materials = dict(objects_in(root, "accessors")), dict(objects_in(root, "materials"))
    used = root.get("extensionsUsed")
    quantized = isinstance(used, list) and "KHR_mesh_quantization" in used
    for m, mesh in objects_in(root, "meshes"):
        for p, primitive in objects_in(mesh, "primitives"):
            path: tuple[str | int, ...] = ("meshes", m, "primitives", p)
            attributes = primitive.get("attributes")
            given = attributes if isinstance(attributes, dict) else {}
            _check_names(given, (*path, "attributes"), report)
            if not quantized:
                _check_types(accessors, given, (*path, "attributes"), report)
            index = primitive.get("indices")
            kind = accessors.get(index, {}).get("componentType") if isinstance(index, int) else None
            if isinstance(kind, int) and kind not in _INDICES and kind != _FLOAT:
                at = (*path, "indices")
                report(wording.STORAGE, "unsigned integers", f"component type {kind}", at)
            _check_targets(accessors, primitive, given, path, report)
            _check_tangents(document, given, (*path, "attributes"), report)
            _check_texture_sets(materials, primitive, given, path, report)


def _check_names(given: Json, path: tuple[str | int, ...], report: _Report) -> None:
    for name in given:
        if not _KNOWN.fullmatch(name):
            wanted = "an attribute of the specification, or a name that begins with _"
            report(wording.STORAGE, wanted, name, (*path, name))
    for kind in ("TEXCOORD", "COLOR", "JOINTS", "WEIGHTS"):
        sets = sorted(int(n.split("_")[1]) for n in given if re.fullmatch(rf"{kind}_\d{{1,4}}", n))
        if sets != list(range(len(sets))):
            missing = next(n for n, found in enumerate([*sets, -1]) if n != found)
            report(wording.STORAGE, f"{kind}_{missing}", f"{kind}_{sets[-1]}", path)


def _check_types(
    accessors: dict[int, Json], given: Json, path: tuple[str | int, ...], report: _Report
) -> None:
    for name, index in given.items():
        accessor = accessors.get(index, {}) if isinstance(index, int) else {}
        allowed = _TYPES.get(name.split("_")[0])
        kind, normalized = accessor.get("componentType"), accessor.get("normalized") is True
        if allowed and isinstance(kind, int) and (kind, normalized) not in allowed:
            how = "normalised" if normalized else "not normalised"
            wanted = " or ".join(f"{one}{' normalised' * flag}" for one, flag in allowed)
            report(wording.STORAGE, f"component type {wanted}", f"{kind}, {how}", (*path, name))


def _check_targets(
    accessors: dict[int, Json],
    primitive: Json,
    given: Json,
    path: tuple[str | int, ...],
    report: _Report,
) -> None:
    if primitive.get("targets") == []:
        report(wording.STORAGE, "at least one morph target", "none", (*path, "targets"))
    for t, target in objects_in(primitive, "targets"):
        for name, index in target.items():
            at = (*path, "targets", t, name)
            if not _MORPHED.fullmatch(name):
                report(wording.STORAGE, "an attribute that can be morphed", name, at)
            elif name not in given:
                report(wording.STORAGE, f"{name} in the attributes of the primitive", "none", at)
            accessor = accessors.get(index, {}) if isinstance(index, int) else {}
            if name == "POSITION" and accessor and not {"min", "max"} <= accessor.keys():
                report(wording.STORAGE, "an accessor with min and max", "one without", at)


def _check_tangents(
    document: Document, given: Json, path: tuple[str | int, ...], report: _Report
) -> None:
    index = given.get("TANGENT")
    if not isinstance(index, int) or not 0 <= index < len(document.accessors):
        return
    try:
        rows = document.accessors.components(index)
    except FormatError as problem:
        found = problem.diagnostic.message
        report(wording.STORAGE, "readable tangents", found, (*path, "TANGENT"))
        return
    if rows is None or rows.shape[1] != 4 or not np.isfinite(rows).all():
        return
    lengths = np.linalg.norm(rows[:, :3], axis=1)
    odd = np.abs(lengths - 1.0) > _NORMAL_ROUNDING
    if odd.any():
        at = int(odd.argmax())
        found = f"{int(odd.sum())} of another length (first: {lengths[at]:.6g} at vertex {at})"
        report(wording.STORAGE, "tangents of unit length", found, (*path, "TANGENT"))
    signs = np.abs(np.abs(rows[:, 3]) - 1.0) > _NORMAL_ROUNDING
    if signs.any():
        at = int(signs.argmax())
        found = f"{rows[at, 3]:.6g} at vertex {at}"
        report(wording.STORAGE, "1 or -1 as the sign of a tangent", found, (*path, "TANGENT"))


def _check_texture_sets(
    materials: dict[int, Json],
    primitive: Json,
    given: Json,
    path: tuple[str | int, ...],
    report: _Report,
) -> None:
    """Check that the primitive has the sets of texture coordinates that its material uses."""
    index = primitive.get("material")
    material = materials.get(index, {}) if isinstance(index, int) else {}
    surface = material.get("pbrMetallicRoughness")
    owners = [material, surface if isinstance(surface, dict) else {}]
    references = [
        value
        for each in owners
        for name, value in each.items()
        if name.endswith("Texture") and isinstance(value, dict)
    ]
    sets: set[int] = set()
    for each in references:
        moved = part(each, "extensions", "KHR_texture_transform", "texCoord")
        number = each.get("texCoord", 0) if moved is None else moved
        sets |= {number} if isinstance(number, int) else set()
    missing = sorted(number for number in sets if f"TEXCOORD_{number}" not in given)
    if missing:
        report(wording.STORAGE, f"TEXCOORD_{missing[0]}, which the material uses", "none", path)


def _check_structure(
    root: Json, tree: NodeTree, skins: tuple[NodeSkin, ...], report: _Report
) -> None:
    """Check members that depend on each other."""
    for name in _LISTS:
        if root.get(name) == []:
            report(wording.STRUCTURE, "at least one item", "none", (name,))
    for index, node in objects_in(root, "nodes"):
        _check_node(node, index, report)
    _check_skinned(root, tree, skins, report)
    for index, scene in objects_in(root, "scenes"):
        seen: set[int] = set()
        for place, root_node in enumerate(list_in(scene, "nodes")):
            if isinstance(root_node, int) and root_node in seen:
                at = ("scenes", index, "nodes", place)
                report(wording.G003_STRUCTURE, "each node once", f"node {root_node} again", at)
            elif isinstance(root_node, int):
                seen.add(root_node)
    nodes = dict(objects_in(root, "nodes"))
    for index, animation in objects_in(root, "animations"):
        for name in ("channels", "samplers"):
            if animation.get(name) == []:
                report(
                    "G005.structure: expected {wanted}, found {found}",
                    "at least one item",
                    "none",
                    ("animations", index, name),
                )
        for place, channel in objects_in(animation, "channels"):
            moved, node = part(channel, "target", "path"), part(channel, "target", "node")
            owner = nodes.get(node, {}) if isinstance(node, int) else {}
            if "skin" in owner and moved in ("translation", "rotation", "scale"):
                report(
                    "G007.skinned-moved: expected {wanted}, found {found}",
                    "a node without a skinned mesh",
                    f"a node with a skinned mesh, whose {moved} has no effect",
                    ("animations", index, "channels", place, "target", "path"),
                )
    _check_extensions(root, report)


def _check_node(node: Json, index: int, report: _Report) -> None:
    path = ("nodes", index)
    if node.get("children") == []:
        report(wording.G003_STRUCTURE, "at least one child", "none", (*path, "children"))
    for name in ("skin", "weights"):
        if name in node and "mesh" not in node:
            report(wording.G003_STRUCTURE, "a node with a mesh", "one without", (*path, name))
    matrix = node.get("matrix")
    if isinstance(matrix, list) and len(matrix) == 16 and _is_sheared(matrix):
        wanted = "a matrix of a translation, rotation and scale"
        report(wording.G003_STRUCTURE, wanted, "a sheared one", (*path, "matrix"))


def _is_sheared(matrix: list[Any]) -> bool:
    """Return whether the axes of a matrix are not perpendicular."""
    if not all(isinstance(each, int | float) and abs(each) < 1e30 for each in matrix):
        return False
    axes = np.array(matrix, dtype=np.float64).reshape(4, 4)[:3, :3]
    lengths = np.linalg.norm(axes, axis=1, keepdims=True)
    cosines = axes @ axes.T / np.maximum(lengths @ lengths.T, 1e-30)
    return bool((np.abs(cosines - np.diag(np.diag(cosines))) > _SHEAR).any())


def _check_skinned(
    root: Json, tree: NodeTree, skins: tuple[NodeSkin, ...], report: _Report
) -> None:
    """Check that skinned meshes are in a scene with their joints."""
    tops = roots_of(tree.parents)
    scenes = [
        {node for node in list_in(scene, "nodes") if isinstance(node, int)}
        for _, scene in objects_in(root, "scenes")
    ]
    for node in np.flatnonzero(tree.skins >= 0).tolist():
        joints = skins[int(tree.skins[node])].joints.tolist()
        top, roots = int(tops[node]), set(tops[joints].tolist())
        shown = [scene for scene in scenes if top in scene]
        if shown and not any(scene >= roots for scene in shown):
            wanted = "joints in the scene of the mesh"
            report(
                "G004.structure: expected {wanted}, found {found}",
                wanted,
                "joints outside it",
                ("nodes", node),
            )


def _check_extensions(root: Json, report: _Report) -> None:
    """Check that all extensions are declared."""
    used = [name for name in list_in(root, "extensionsUsed") if isinstance(name, str)]
    for place, name in enumerate(list_in(root, "extensionsRequired")):
        if isinstance(name, str) and name not in used:
            at = ("extensionsRequired", place)
            report(wording.STRUCTURE, "a name that extensionsUsed contains", name, at)
    told: set[str] = set()
    stack: list[tuple[object, tuple[str | int, ...]]] = [(root, ())]
    while stack:
        value, path = stack.pop()
        if isinstance(value, list):
            stack += [(each, (*path, place)) for place, each in enumerate(value)]
        if not isinstance(value, dict):
            continue
        for name, each in value.items():
            if name == "extensions" and isinstance(each, dict):
                for extension in each:
                    if extension not in used and extension not in told:
                        told.add(extension)
                        at = (*path, name, extension)
                        report(wording.STRUCTURE, "a name in extensionsUsed", extension, at)
            elif name != "extras" and isinstance(each, dict | list):
                stack.append((each, (*path, name)))
