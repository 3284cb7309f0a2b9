"""Confidence in a rig: whether what was found in the target is what the template has.

The surface of a template can be pressed into any shape, so a small distance between the surfaces
says little. A rig is right if the limbs of the template are where the target has limbs:

- the surfaces meet, from the target to the template and back, more closely if no limbs were found;
- bones are inside the solid, each of those of arms and legs, as deep as in the template, and along
  the middle of its legs: those of a bird or of a robot may bend where a person's do not;
- the solid is as thick as that of the template: a picture cut out of cardboard is not;
- the trunk is as upright as in the template, unless the surfaces agree closely: a bird with its
  wings for arms leans forward, a person whose rig is a fox's lies on the back;
- shoulders and hips are as parallel as in the template: a bent limb may be taken for another one;
- arms are not above a head that is hardly above the shoulders: they may be the ears of a rabbit;
- nor are shoulders near the hips, far below the head: they may be the corners of a coat; nor beside
  the head: arms may be made of buns of hair;
- both legs are not in the same place, as where one is missing;
- bones have 0.3 to 4 times the length that they have in the template, relative to the other bones,
  and arms at least 0.85 times: an arm that touches the body may seem to end there;
- a test pose that bends all joints keeps the volume.

Measures that no threshold divides into right and wrong rigs are left out: differences between left
and right, as the fit scales both together; lengths above those of other limbs, as the ears of a
rabbit are longer than its legs; and the height of the head alone, as that of a rabbit is no
higher than in a person's rig that is upside down.

Each finding is rated from 0, wrong, to 1, as for figures that are rigged well; the least rating is
the confidence.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.autorig.alignment.orientation_search import axis_direction, nearest_axis
from viewer.autorig.alignment.surface_alignment import (
    DEFAULT_UP,
    PART,
    AlignedBy,
    Alignment,
    misfit,
)
from viewer.autorig.anatomy import LimbPair, arc_lengths
from viewer.autorig.solid import Solid, solid_of
from viewer.autorig.surface.welding import weld
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note
from viewer.errors import RigError
from viewer.phrases import percent
from viewer.progress import part_of_work, report_fraction
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.geometry.topology import part_volumes
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.hierarchy import descendants
from viewer.rigs.mesh import Mesh, triangle_areas
from viewer.rigs.pose import Pose
from viewer.rigs.retargeting.mirror import joint_partners
from viewer.rigs.skeleton import Skeleton, joint_label
from viewer.rigs.skin import Skin
from viewer.rigs.skinning import deform, joint_matrices
from viewer.rigs.skinning.lbs import move

ENOUGH = 0.5
"""Confidence below which a rig is probably wrong."""
_SURE = 0.75  # confidence below which a rig may be wrong

_FOUND: tuple[AlignedBy, ...] = ("search", "fit", "in place")  # by the program
_UNLIKE = "this mesh is probably not a figure like the template, or not oriented as assumed"
_REMEDY = (
    "use a template of the same kind (--from body for people, --from fox for four-legged animals) "
    "or none (--auto), specify --up, --facing or --landmarks, or keep the rig if it is right "
    "(--keep-doubtful)"
)
# Misfits that are rated 0 and 1. Where limbs were found, hair, ears and armour of another shape may
# be apart; where none were found, only a shape that agrees everywhere shows that they are there.
_FOUND_LIMBS, _NO_LIMBS = (0.045, 0.02), (0.03, 0.01)
_SAME_KIND = 0.01  # misfit up to which a trunk may lean
# Height of the head above the shoulders relative to the template's, below which arms may be ears.
_NECK = 0.5
_UPRIGHT = np.cos(np.radians(45.0))  # of the angle of an upright trunk: animals have no arms
_BEND = np.radians(40.0)  # rotation of every joint in the test pose
_ALONG = np.linspace(0.1, 0.9, 9)  # places on a bone that are looked at
_FOOT = 0.15  # part of a leg's path from its tip that is left out: toes may have no bones
_LONG = 0.04  # shortest bone that counts, as a fraction of the template's size
_LONG_BONE = 0.5  # length of the first long bone of a limb, relative to the longest one
_BESIDE = 1.5  # distance from the nearest voxel's centre up to which a bone is inside, in voxels


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A posed mesh with the joints of its rig."""

    positions: Floats
    """(V, 3)."""
    triangles: Ints
    """(T, 3)."""
    skin: Skin
    joints: Floats
    """(J, 3). In the frame of the positions."""
    solid: Solid


@dataclass(frozen=True, slots=True, eq=False)
class Finding:
    """One property of a rig."""

    sentence: str
    """Key and sentence of the message about it."""
    value: float
    """In the unit of ``wrong`` and ``good``."""
    wrong: float
    good: float
    """Values that are rated 0 and 1."""
    joint: str = ""
    """Label of the joint that it is about, if the sentence has one."""

    @property
    def line(self) -> Diagnostic:
        """Return the message about it."""
        named = {"joint": self.joint} if self.joint else {}
        # The values of ``{value}`` are fractions; those of ``{value:.2g}`` are not.
        is_fraction = "{value}" in self.sentence
        return note(
            self.sentence, value=percent(self.value) if is_fraction else self.value, **named
        )

    @property
    def rating(self) -> float:
        """From 0, wrong, to 1, good."""
        return float(np.clip((self.value - self.wrong) / (self.good - self.wrong), 0.0, 1.0))


def confidence(found: tuple[Finding, ...]) -> float:
    """Return the least rating, 1 for a rig that was not judged."""
    return min((finding.rating for finding in found), default=1.0)


def remarks(found: tuple[Finding, ...]) -> Iterator[Diagnostic]:
    """Return the doubts; if there are none, a message about findings that are nearly one."""
    yield from doubts(found)
    near = sorted((each for each in found if each.rating < _SURE), key=lambda each: each.rating)
    if near and near[0].rating >= ENOUGH:
        reasons = "; ".join(str(each.line) for each in near)
        yield note(
            "R017.unsure: the rig may be wrong: {reasons}: check it in several poses",
            reasons=reasons,
        )


def doubts(found: tuple[Finding, ...]) -> Iterator[Diagnostic]:
    """Return a message about each finding that says that the rig is wrong, the worst first."""
    for finding in sorted(found, key=lambda finding: finding.rating):
        if finding.rating < ENOUGH:
            yield finding.line


def judge(
    template: Figure,
    pose: Pose,
    figure: Figure,
    figure_pose: Pose,
    target: Mesh,
    alignment: Alignment,
    solids: tuple[Solid, Solid] | None = None,
    legs: tuple[LimbPair, ...] = (),
    up: str | None = None,
) -> tuple[Finding, ...]:
    """Return what speaks for and against a rig of a target, made from that of a posed template.

    ``legs``: those of the target, if they were found. ``up``: its up axis, if it is stated.
    ``figure`` in ``figure_pose`` is the rigged target. Nothing is judged if the user has placed the
    template, or if a part of a figure, such as clothes, is where the template has it.
    """
    if alignment.how not in _FOUND or (alignment.how == "in place" and alignment.away > PART):
        return ()
    mesh, skeleton, skin = template.attached()
    posed = deform(template, pose)[0]
    report_fraction(0.0, "judging the rig")
    if solids is None:
        with part_of_work(span=(0.0, 0.4)):
            own = solid_of(posed, mesh.triangles)
        with part_of_work(span=(0.4, 0.8)):
            solids = own, solid_of(target.positions, target.triangles)
    joints = joint_matrices(template, pose)[:, :3, 3]
    rigged = joint_matrices(figure, figure_pose)[:, :3, 3]
    if up is None:
        # A template that stays in its own frame has not been turned upright.
        stays = nearest_axis(alignment.similarity.rotation @ axis_direction(template.up))
        up = template.up if stays == template.up else DEFAULT_UP
    ours = Body(posed, mesh.triangles, skin, joints, solids[0])
    theirs = Body(target.positions, target.triangles, figure.require_skin(), rigged, solids[1])
    return (
        *findings(ours, theirs, skeleton.parents, alignment, legs),
        *_posture(template, ours, theirs, axis_direction(up), alignment),
    )


def refusal(found: tuple[Finding, ...], facing: Diagnostic | None = None) -> str:
    """Return what is wrong with a rig, what helps, and why; empty if it is probably right.

    ``facing``: the message that front and back look alike, and what helps if they are swapped.
    """
    reasons = "; ".join(str(line) for line in doubts(found))
    if not reasons:
        return ""
    remedy = _REMEDY if facing is None else f"{facing}; otherwise {_REMEDY}"
    return f"{_UNLIKE}; {remedy}; reasons: {reasons}"


def findings(
    template: Body,
    target: Body,
    parents: Ints,
    alignment: Alignment,
    legs: tuple[LimbPair, ...] = (),
) -> tuple[Finding, ...]:
    """Return what speaks for and against a rig of a target, made from that of a template."""
    bones = _long_bones(parents, template)
    lengths = _growths(template.joints, target.joints, bones)
    scale = float(np.median(lengths))
    return (
        Finding(
            "R017.surface: template and mesh differ in shape by {value:.1%} of the size",
            misfit(alignment, False),
            *(_FOUND_LIMBS if alignment.has_limbs else _NO_LIMBS),
        ),
        # Without the cap of the misfit, by which hair counts as little as a missing limb.
        Finding(
            "R017.covered: parts of the mesh are far from the template (RMS distance {value:.1%} "
            "of the size of the mesh)",
            alignment.error,
            wrong=0.12,
            good=0.06,
        ),
        *_bones_inside(template, target, bones, scale),
        *_bones_in_legs(target, parents, legs),
        Finding(
            "R017.thickness: the mesh is only {value:.2g} times as thick as the template",
            _thickness(target) / max(_thickness(template), 1e-12),
            wrong=0.1,
            good=0.5,
        ),
        Finding(
            "R017.volume: the mesh collapses where joints bend (a test pose keeps {value} of "
            "the volume that it keeps in the template)",
            _kept(target, parents, bones) / _kept(template, parents, bones),
            wrong=0.6,
            good=0.9,
        ),
        Finding(
            "R017.short: a bone has only {value:.2g} times its relative length in the template",
            float(lengths.min()) / scale,
            wrong=0.1,
            good=0.3,
        ),
        Finding(
            "R017.long: a bone has {value:.2g} times its relative length in the template",
            float(lengths.max()) / scale,
            wrong=8.0,
            good=4.0,
        ),
    )


def _bones_inside(template: Body, target: Body, bones: Ints, scale: float) -> tuple[Finding, ...]:
    """Return findings about bones that are inside the template, none without any."""
    own, other = (_depths(body, bones) for body in (template, target))
    inside = own > 0.0
    if not inside.any():
        return ()
    return (
        Finding(
            "R017.inside: only {value} of the bones are inside the mesh",
            float((other[inside] > 0.0).mean()),
            wrong=0.3,
            good=0.7,
        ),
        Finding(
            "R017.depth: the bones are outside the mesh or near its surface (at {value} of "
            "their depth in the template)",
            float(np.median(other[inside] / (scale * own[inside]))),
            wrong=0.1,
            good=0.4,
        ),
    )


def _bones_in_legs(target: Body, parents: Ints, legs: tuple[LimbPair, ...]) -> tuple[Finding, ...]:
    """Return a finding about the pair of legs whose bones follow it least, none without legs."""
    ends = np.flatnonzero(parents >= 0)
    starts, ways = target.joints[parents[ends]], target.joints[ends] - target.joints[parents[ends]]
    squares = np.maximum(np.einsum("ba,ba->b", ways, ways), 1e-300)
    followed = []
    for pair in legs:
        parts = []
        for leg in pair.limbs:
            arc = arc_lengths(leg.points)
            rows = arc >= _FOOT * arc[-1]
            # The closest point of each bone: its start plus t of its way, 0 <= t <= 1.
            apart = leg.points[rows, None] - starts
            along = np.clip(np.einsum("nba,ba->nb", apart, ways) / squares, 0.0, 1.0)
            gaps = np.linalg.norm(apart - along[..., None] * ways, axis=2).min(axis=1)
            # Paths and radii are known to a voxel: shins of that thickness are left by the path.
            radii = leg.radii[rows] + target.solid.spacing
            parts.append(float((gaps <= radii).mean()))
        followed.append(float(np.mean(parts)))
    if not followed:
        return ()
    # Halfway between the limits, half of a leg is away from the bones.
    return (
        Finding(
            "R017.legs: bones follow only {value} of the legs",
            min(followed),
            wrong=0.25,
            good=0.75,
        ),
    )


def _long_bones(parents: Ints, body: Body) -> Ints:
    """Return parents and ends (B, 2) of the bones that are not short, of all if all are."""
    size = float(np.ptp(body.positions[body.triangles.ravel()], axis=0).max())
    ends = np.flatnonzero(parents >= 0)
    lengths = np.linalg.norm(body.joints[ends] - body.joints[parents[ends]], axis=1)
    long = ends[lengths >= _LONG * size]
    ends = long if len(long) else ends
    return np.stack([parents[ends], ends], axis=1)


def _posture(
    template: Figure, ours: Body, theirs: Body, up: Floats, alignment: Alignment
) -> tuple[Finding, ...]:
    """Return findings about trunk, limbs and head, none if the template has no two pairs of limbs.

    ``ours``: the posed template; ``up``: the target's axis.
    """
    try:
        partners = joint_partners(template)
    except RigError:
        return ()  # without symmetry, there are no pairs
    parents = template.require_skeleton().parents
    joints, rigged = ours.joints, theirs.joints
    trunk = _trunk(parents, partners, joints)
    if trunk is None:
        return ()
    angles = []
    for places, vertical in ((joints, axis_direction(template.up)), (rigged, up)):
        way = unit(places[list(trunk[1])].mean(axis=0) - places[list(trunk[0])].mean(axis=0))
        angles.append(float(np.degrees(np.arccos(np.clip(way @ vertical, -1.0, 1.0)))))
    found = []
    # A person who bows fits as closely as one who stands upright.
    if misfit(alignment, False) > _SAME_KIND:
        # Halfway: 40 degrees. Characters that are rigged well have up to 20, a bird with the arms
        # of a person in its wings 46, animals with two legs for four, or the reverse, 50 to 95.
        leaning = Finding(
            "R017.trunk: the lean of the trunk differs from the template's by {value:.0f} degrees",
            abs(angles[1] - angles[0]),
            wrong=55.0,
            good=25.0,
        )
        found.append(leaning)
    starts = [[_begin(parents, joints, joint) for joint in pair] for pair in trunk]
    ways = [
        [unit(places[left] - places[right]) for left, right in starts]
        for places in (joints, rigged)
    ]
    twists = [float(np.degrees(np.arccos(np.clip(one @ other, -1.0, 1.0)))) for one, other in ways]
    # Halfway: 50 degrees, a little more than people can twist. In 48 rigs that are right, it is at
    # most 12; where a foot of a person who kneels misleads a hip, 41; where a shoulder of a runner
    # is at the chest, 123.
    twisted = Finding(
        "R017.twist: the rig's shoulders and hips are rotated against each other by {value:.0f} "
        "degrees more than in the template",
        abs(twists[1] - twists[0]),
        wrong=80.0,
        good=20.0,
    )
    found.append(twisted)
    heights = joints @ axis_direction(template.up)
    legs, arms = sorted(trunk, key=lambda pair: float(heights[list(pair)].sum()))
    found += _limbs_inside(ours, theirs, template.require_skeleton(), trunk)
    head = _head(parents, partners, heights, arms)
    is_upright = abs(np.cos(np.radians(angles[0]))) > _UPRIGHT
    standing = (legs,) if is_upright else trunk
    found.append(_apart(parents, partners, rigged, standing))
    if not is_upright or head is None:
        return tuple(found)
    ends = [_end(parents, joints, joint) for joint in arms]
    own_lengths, found_lengths = (
        sum(_arm_length(parents, places, *ends_of) for ends_of in zip(arms, ends, strict=True))
        for places in (joints, rigged)
    )
    scale = float(np.median(_growths(joints, rigged, _long_bones(parents, ours))))
    # In 60 rigs that are right, it is 0.84 and more. With arms that seem to end at the hips or the
    # chest, which they touch, or arms made of hair or of the brim of a hat, it is 0.36 to 0.71.
    arms_found = Finding(
        "R017.arms: the arms are only {value:.2g} times as long as the template's, relative to the "
        "other bones (they are short, or what they touch hides their ends)",
        found_lengths / max(scale * own_lengths, 1e-12),
        wrong=0.3,
        good=0.85,
    )
    found.append(arms_found)
    rises = []
    for places in (joints, rigged):
        hips, shoulders, hands = (places[list(each)].mean(axis=0) for each in (legs, arms, ends))
        trunk_way = shoulders - hips
        length = max(float(np.linalg.norm(trunk_way)), 1e-12)
        points = 0.5 * (shoulders + hands), places[head], shoulders
        rises.append([float(point @ trunk_way) / length**2 for point in points])
    usual, own = (top - shoulder for _, top, shoulder in rises)
    # People have 0.3, characters 0.1 to 0.7. Lowered sleeves that touch the trunk everywhere are no
    # limbs; if arms are then made of what swings beside the hips, it is 1 or more.
    neck = Finding(
        "R017.neck: the head is above the shoulders by {value:.1f} times the length of the trunk",
        own,
        wrong=1.25,
        good=0.75,
    )
    # In 60 rigs that are right, it is 0.12 and more, 0.18 for a rabbit. With tufts of hair or lamps
    # of a helmet for arms, it is 0.01 to 0.08.
    low = Finding(
        "R017.low: the head is only {value} of the trunk's length above the shoulders (it has "
        "no neck, or the arms are hair or ears)",
        own,
        wrong=0.0,
        good=0.2,
    )
    found += [neck, low]
    if own > _NECK * usual:
        return tuple(found)  # people may raise their arms
    # People with outstretched arms have about 0; a rabbit with its ears for arms has 0.2 to 0.3.
    raised = Finding(
        "R017.head: the middle of the arms is {value} of the trunk's length above head and "
        "shoulders (they may be ears)",
        rises[1][0] - max(rises[1][1:]),
        wrong=0.2,
        good=0.0,
    )
    return (*found, raised)


def _limbs_inside(
    template: Body, target: Body, skeleton: Skeleton, pairs: tuple[tuple[int, int], ...]
) -> tuple[Finding, ...]:
    """Return a finding about the bone of a limb that is least inside, none without any.

    The last bones are left out: stumps have no toes, mittens no fingers. So are ears and tails, as
    not all animals have them.
    """
    parents = skeleton.parents
    bones = _long_bones(parents, template)
    firsts = [joint for pair in pairs for joint in pair]
    in_limbs = np.any([descendants(parents, joint) for joint in firsts], axis=0)
    bones = bones[in_limbs[bones[:, 1]] & np.isin(bones[:, 1], parents)]
    inside = _depths(template, bones) > 0.0
    bones, inside = (rows[inside.mean(axis=1) >= 0.5] for rows in (bones, inside))
    if len(bones) == 0:
        return ()
    # Depths are known to a voxel: the arms of a thin robot may be as far beside its bones.
    solid, points = target.solid, _points_on(target, bones)
    near = solid.gaps(points.reshape(-1, 3)).reshape(inside.shape) <= _BESIDE * solid.spacing
    parts = (near & inside).sum(axis=1) / inside.sum(axis=1)
    least = int(parts.argmin())
    # Where an arm is not, as behind a gun that is taken for it, its bones are in the air, although
    # nearly all others are inside.
    return (
        Finding(
            "R017.bone: most of the bone that ends at {joint} is outside the mesh ({value} is "
            "inside)",
            float(parts[least]),
            wrong=0.2,
            good=0.6,
            joint=joint_label(skeleton, int(bones[least, 1])),
        ),
    )


def _apart(
    parents: Ints, partners: Ints, joints: Floats, legs: tuple[tuple[int, int], ...]
) -> Finding:
    """Return a finding about joints of both legs of a pair: both may be in the same one."""
    ratios = []
    for left, right in legs:
        # Toes may meet; knees and ankles are where the legs are.
        limb = np.flatnonzero(
            descendants(parents, left) & np.isin(np.arange(len(parents)), parents)
        )
        gaps = np.linalg.norm(joints[limb] - joints[partners[limb]], axis=1)
        ratios.append(float(gaps.min() / max(np.linalg.norm(joints[left] - joints[right]), 1e-12)))
    # People whose legs taper have 0.75 and more; with one leg missing, it is 0.3 to 0.5.
    return Finding(
        "R017.apart: both legs of the rig may be in the same leg of the mesh (they are only "
        "{value} of the width of the hips apart)",
        min(ratios),
        wrong=0.2,
        good=0.7,
    )


def _trunk(
    parents: Ints, partners: Ints, joints: Floats
) -> tuple[tuple[int, int], tuple[int, int]] | None:
    """Return the first joints of the longest pairs of limbs at both ends of the trunk, or None."""
    reach = np.zeros(len(parents))
    for joint in range(len(parents) - 1, -1, -1):
        if (parent := int(parents[joint])) >= 0:
            # Children come after their parents, so the joint's own reach is already final.
            step = float(np.linalg.norm(joints[joint] - joints[parent]))
            reach[parent] = max(reach[parent], reach[joint] + step)
    firsts = [
        joint
        for joint, parent in enumerate(parents.tolist())
        if joint < partners[joint] and parent >= 0 and partners[parent] == parent
    ]
    firsts.sort(key=lambda joint: -reach[joint])
    others = [joint for joint in firsts if parents[joint] != parents[firsts[0]]]
    if not others:
        return None
    one, other = ((joint, int(partners[joint])) for joint in (firsts[0], others[0]))
    return one, other


def _head(parents: Ints, partners: Ints, heights: Floats, arms: tuple[int, int]) -> int | None:
    """Return the highest joint between the sides that is below the same joint as the arms."""
    chest = int(parents[arms[0]])
    between = np.flatnonzero(descendants(parents, chest) & (partners == np.arange(len(parents))))
    head = int(between[heights[between].argmax()])
    return None if head == chest else head


def _end(parents: Ints, joints: Floats, joint: int) -> int:
    """Return the joint of a limb that is farthest from its first one."""
    limb = np.flatnonzero(descendants(parents, joint))
    return int(limb[np.linalg.norm(joints[limb] - joints[joint], axis=1).argmax()])


def _begin(parents: Ints, joints: Floats, first: int) -> int:
    """Return the joint at which the first long bone of a limb begins: behind the collarbone."""
    chain = [_end(parents, joints, first)]
    while chain[-1] != first:
        chain.append(int(parents[chain[-1]]))
    lengths = np.linalg.norm(joints[chain[:-1]] - joints[chain[1:]], axis=1)
    long = np.flatnonzero(lengths >= _LONG_BONE * lengths.max(initial=0.0))
    return chain[int(long[-1]) + 1] if len(long) else first


def _arm_length(parents: Ints, joints: Floats, first: int, end: int) -> float:
    """Return the length of the chain of bones from the first joint of a limb to its end."""
    length = 0.0
    while end != first:
        length += float(np.linalg.norm(joints[end] - joints[parents[end]]))
        end = int(parents[end])
    return length


def _growths(before: Floats, after: Floats, bones: Ints) -> Floats:
    """Return the ratio of the lengths of bones, from joints (J, 3) in both."""
    lengths = [
        np.linalg.norm(joints[bones[:, 1]] - joints[bones[:, 0]], axis=1)
        for joints in (before, after)
    ]
    return lengths[1] / np.maximum(lengths[0], 1e-12)


def _depths(body: Body, bones: Ints) -> Floats:
    """Return the distances from the surface along the bones, 0 outside: (B, A)."""
    voxels = body.solid.voxel_of(_points_on(body, bones))
    # Points beyond the grid are clamped to its border, which is outside.
    depths: Floats = body.solid.distance[tuple(np.moveaxis(voxels, -1, 0))]
    return depths


def _points_on(body: Body, bones: Ints) -> Floats:
    """Return points along the bones: (B, A, 3)."""
    starts, ends = body.joints[bones[:, 0]], body.joints[bones[:, 1]]
    points: Floats = starts[:, None] + _ALONG[:, None] * (ends - starts)[:, None]
    return points


def _thickness(body: Body) -> float:
    """Return the least extent of the surface over the middle one: a sheet has nearly 0."""
    corners = body.positions[body.triangles]
    centers, areas = corners.mean(axis=1), triangle_areas(body.positions, body.triangles)
    spreads = np.linalg.eigvalsh(np.cov(centers.T, aweights=areas))
    return float(np.sqrt(max(spreads[0], 0.0) / max(spreads[1], 1e-300)))


def _kept(body: Body, parents: Ints, bones: Ints) -> float:
    """Return the fraction of the volume that remains if all joints bend, the lower of two poses."""
    mesh = weld(body.positions, body.triangles)
    islands = mesh.islands[mesh.vertices[body.triangles[:, 0]]]

    def volume(positions: Floats) -> float:
        # Each part about its own middle: an open sheet, such as a cape, has a volume of nearly 0
        # there, but any other one elsewhere. Parts that are inside out count, too.
        corners = positions[body.triangles]
        return float(np.abs(part_volumes(corners, islands, mesh.n_islands)[0]).sum())

    before = max(volume(body.positions), 1e-300)
    axis = np.zeros((len(parents), 3))
    along = unit(body.joints[bones[:, 1]] - body.joints[bones[:, 0]])
    axis[bones[:, 0]] = along
    axis[bones[:, 1]] = along
    across = unit(np.cross(axis, np.eye(3)[np.abs(axis).argmin(axis=1)]))
    found = []
    for axes in (across, np.cross(axis, across)):
        own = rotation_vector_to_matrix(_BEND * axes)
        moves = np.tile(np.eye(4), (len(parents), 1, 1))
        for joint, parent in enumerate(parents.tolist()):
            # Rotation about the joint, within the parent's: p -> R (p - c) + c.
            moves[joint, :3, :3] = own[joint]
            moves[joint, :3, 3] = body.joints[joint] - own[joint] @ body.joints[joint]
            if parent >= 0:
                moves[joint] = moves[parent] @ moves[joint]
        posed = move(body.positions, body.skin, moves)[0]
        found.append(volume(posed) / before)
    return min(found)
