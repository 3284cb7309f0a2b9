"""Intermediate values of the skinning of one vertex, for verification by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.phrases import printable
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.inspection.single_vertices import check_vertices
from viewer.rigs.kinematics import posed_skeleton
from viewer.rigs.number_text import number_text
from viewer.rigs.pose import Pose, placement_matrix
from viewer.rigs.scalars import joint_text
from viewer.rigs.shape import rest_positions, shaped
from viewer.rigs.skin import Skin, bind_positions, has_influence, skin_rows, strongest_first
from viewer.rigs.skinning import METHODS, Skinning, skin_used, skinned
from viewer.rigs.skinning.dqs import moved_rigidly, split_palette

_TINY = 1e-12  # sums of weights or quaternions below this define no rotation
_LONGEST = 40  # maximum number of characters of a joint's name
_RIGID = 1e-9  # tolerance within which a stretch is treated as the identity


@dataclass(frozen=True, slots=True, eq=False)
class DualTerms:
    """The terms of dual quaternion skinning (Kavan et al. 2008, section 4)."""

    fractions: Floats
    """(K,). Weights divided by their sum, w_i / sum_j w_j."""
    duals: Floats
    """(K, 8). Each influence's unit dual quaternion (x, y, z, w), real part, then dual part."""
    signs: Floats
    """(K,). -1 if the quaternion was negated, into the hemisphere of the strongest influence."""
    stretches: Floats
    """(K, 3, 4). The non-rigid part of each matrix, applied before the rigid motion."""
    blended: Floats
    """(8,). sum_i fraction_i sign_i dual_i."""
    length: float
    """Length of the real part of ``blended``, by which both parts are divided."""
    stretched: Floats
    """(3,). The rest position, transformed by sum_i fraction_i stretch_i."""
    position: Floats
    """(3,). ``stretched``, moved by the blended dual quaternion; the rest position if influences
    cancel."""


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """All steps from the vertex in the file to its drawn position."""

    vertex: int
    """Index of the vertex."""
    skinning: Skinning
    """Skinning options."""
    stored: Floats
    """(3,). Position in the file, bind pose."""
    shaped: Floats
    """(3,). Position after the figure's blend shapes."""
    rest: Floats
    """(3,). Position p before skinning, after blend shapes and pose correctives."""
    joints: Ints
    """(K,). Joints of the effective influences, strongest first."""
    names: tuple[str, ...]
    """Names of these joints."""
    weights: Floats
    """(K,). w_i, pruned and normalised if enabled."""
    matrices: Floats
    """(K, 4, 4). M_i: skinning matrices, bind pose to figure space."""
    images: Floats
    """(K, 3). M_i p: the vertex transformed by each joint alone."""
    terms: Floats
    """(K, 3). w_i M_i p."""
    linear: Floats
    """(3,). Sum of the terms: linear blend skinning; the rest position of a vertex without
    influence."""
    dual: DualTerms | None
    """Terms of methods that use dual quaternions; None for other methods."""
    skinned: Floats
    """(3,). Result of the skinning method."""
    placement: Floats
    """(4, 4). The figure's own scale and translation, applied last."""
    position: Floats
    """(3,). Drawn position, figure space."""

    @property
    def is_free(self) -> bool:
        """Whether the vertex has no influence and stays at its bind position."""
        return not bool((self.weights != 0.0).any())


def explain(figure: Figure, pose: Pose, skinning: Skinning, vertex: int) -> Explanation:
    """Return all intermediate values of the skinning of one vertex, lengths in figure units.

    Linear blend skinning: v' = sum_i w_i M_i [p 1]. Dual quaternion skinning: q = sum_i s_i q_i
    w_i / sum_j w_j, v' = (q / |q|) applied to the stretched p.
    """
    if not figure.is_attached:
        raise RigError(f"figure {figure.name} has no skin attached to a skeleton")
    chosen = np.array([vertex], dtype=np.int32)
    check_vertices(figure, chosen)
    if skinning.blend_factor is None:
        stated = figure.require_skin().dqs_fractions
        factor = 0.0 if stated is None else float(stated[vertex])
        skinning = replace(skinning, blend_factor=factor)
    stored, figure = figure.require_mesh().positions[vertex], shaped(figure, pose.shape_weights)
    mesh, skeleton, skin = figure.attached()
    rest = rest_positions(figure, mesh, pose, skinning.correctives, chosen)[0]
    row = strongest_first(skin_rows(skin_used(skin, skinning), chosen))
    palette = posed_skeleton(skeleton, pose).palette(skin)
    matrices = palette[row.joints]
    images = matrices[:, :3, :3] @ rest + matrices[:, :3, 3]
    terms = row.weights[:, None] * images
    linear = terms.sum(axis=0) if has_influence(row)[0] else rest
    uses_quaternions = METHODS[skinning.method].uses_quaternions
    dual = _dual_terms(row, palette, rest) if uses_quaternions else None
    moved = skinned(mesh, skin, rest[None], palette, skinning, chosen)[0][0]
    placement = placement_matrix(pose)
    return Explanation(
        vertex,
        skinning,
        stored,
        mesh.positions[vertex],
        rest,
        row.joints,
        tuple(joint_text(figure, joint) for joint in row.joints.tolist()),
        row.weights,
        matrices,
        images,
        terms,
        linear,
        dual,
        moved,
        placement,
        apply_transform(placement, moved),
    )


def explanation_text(explanation: Explanation, digits: int = 4) -> list[str]:
    """Return the values of an explanation as lines, in the order of computation."""
    text = _Text(explanation, digits)
    text.rest()
    if explanation.is_free:
        text.lines.append("no influence: the vertex stays at its bind position")
    for index in range(len(explanation.joints)):
        text.influence(index)
    if not explanation.is_free:
        text.sums()
    if explanation.dual is not None and not explanation.is_free:
        text.dual(explanation.dual)
    text.end()
    return text.lines


def _dual_terms(row: Skin, palette: Floats, rest: Floats) -> DualTerms:
    """Return the terms of dual quaternion skinning for one vertex, as in ``dqs.deform``."""
    duals, stretches = (
        values[row.joints] for values in split_palette(palette, bind_positions(row))
    )
    total = float(row.weights.sum())
    is_moved = abs(total) > _TINY
    fractions = row.weights / (total if is_moved else 1.0)
    signs = np.where(duals[:, :4] @ duals[0, :4] < 0.0, -1.0, 1.0) if len(duals) else np.ones(0)
    blended = (fractions * signs) @ duals
    length = float(np.linalg.norm(blended[:4]))
    stretch = np.einsum("k,kab->ab", fractions, stretches)
    if not is_moved or length <= _TINY:
        return DualTerms(fractions, duals, signs, stretches, blended, length, rest, rest)
    stretched = stretch[:, :3] @ rest + stretch[:, 3]
    position = moved_rigidly((blended / length)[None], stretched[None])[0]
    return DualTerms(fractions, duals, signs, stretches, blended, length, stretched, position)


class _Text:
    """Lines of an explanation in which all numbers have the same width."""

    def __init__(self, explanation: Explanation, digits: int) -> None:
        self.one, self.digits = explanation, digits
        self.method = METHODS[explanation.skinning.method]
        parts = [explanation.stored, explanation.matrices, explanation.images, explanation.position]
        largest = max(float(np.abs(part).max(initial=1.0)) for part in parts)
        self.width = len(f"{-largest:.{digits}f}")
        self.lines = [f"vertex {explanation.vertex}: {self.method.title}"]

    def rest(self) -> None:
        """Add the position before skinning."""
        one = self.one
        self._vector("stored", one.stored)
        if not np.array_equal(one.shaped, one.stored):
            self._vector("+ shape", one.shaped)
        if not np.array_equal(one.rest, one.shaped):
            self._vector("+ correctives", one.rest)
        self._vector("p", one.rest)

    def influence(self, index: int) -> None:
        """Add the matrix of one influence, its image of the vertex, and its term."""
        one, number = self.one, index + 1
        name = printable(one.names[index], _LONGEST)
        self.lines.append(
            f"{number}. {name}: w{number} = {self._number(float(one.weights[index]))}"
        )
        for row, values in enumerate(one.matrices[index]):
            label = f"   M{number} =" if row == 0 else ""
            self.lines.append(f"{label:<8}[ {self._numbers(values)} ]")
        self._vector(f"   M{number} p", one.images[index])
        self._vector(f"   w{number} M{number} p", one.terms[index])

    def sums(self) -> None:
        """Add the sums of weights and terms."""
        self.lines.append(f"sum w = {self._number(float(self.one.weights.sum()))}")
        self._vector("sum w M p", self.one.linear)

    def dual(self, dual: DualTerms) -> None:
        """Add the dual quaternions, their sum, and the resulting position."""
        for index, values in enumerate(dual.duals):
            number = index + 1
            flip = "" if dual.signs[index] > 0.0 else ", negated into the hemisphere of q1"
            weight = f"{dual.fractions[index]:.{self.digits}f}"
            self.lines.append(f"q{number}: normalised weight {weight}{flip}")
            self._quaternions("   ", values)
        self.lines.append("q = sum of normalised weight times q, with these signs")
        self._quaternions("   ", dual.blended)
        self.lines.append(f"length of the real part = {dual.length:.{self.digits}f}")
        identity = np.eye(3, 4)
        if np.abs(dual.stretches - identity).max(initial=0.0) > _RIGID:
            self._vector("stretched p", dual.stretched)
        self._vector("moved by q", dual.position)

    def end(self) -> None:
        """Add the result of the method, the figure's placement, and the final position."""
        one = self.one
        if self.method.result:
            blend_factor = f"{one.skinning.blend_factor:.{self.digits}f}"
            self._vector(self.method.result.format(blend_factor=blend_factor), one.skinned)
        if not np.array_equal(one.placement, np.eye(4)):
            self.lines.append(f"scale = {one.placement[0, 0]:.{self.digits}f}")
            self._vector("translation", one.placement[:3, 3])
        self._vector("position", one.position)

    def _vector(self, label: str, values: Floats) -> None:
        self.lines.append(f"{label:<20}( {self._numbers(values)} )")

    def _quaternions(self, label: str, values: Floats) -> None:
        self.lines.append(f"{label}real [ {self._numbers(values[:4])} ]")
        self.lines.append(f"{label}dual [ {self._numbers(values[4:])} ]")

    def _number(self, value: float) -> str:
        return number_text(value, f".{self.digits}f")

    def _numbers(self, values: Floats) -> str:
        spec = f"{self.width}.{self.digits}f"
        return "  ".join(number_text(value, spec) for value in values.tolist())
