"""Meshes with known skin weights, derived from the bundled figures. Each target includes the
template placed and posed to match it, and the matrix of that placement, so that weights can be
compared with or without the search for an alignment.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

import viewer
from viewer.rigs.mesh import vertex_normals
from viewer.rigs.skin import skin_from_entries

SAMPLES = Path(__file__).resolve().parents[2] / "assets" / "samples"
TURN = np.radians(115.0)


@dataclass(frozen=True)
class Target:
    """A mesh, its true weights, and the template from which it was derived."""

    name: str
    figure: viewer.Figure
    pose: viewer.Pose  # pose of the template
    template: np.ndarray  # (V, 3) posed vertices of the template in the target's space
    template_triangles: np.ndarray
    template_weights: sp.csr_array  # (V, J)
    positions: np.ndarray  # (W, 3)
    triangles: np.ndarray
    weights: sp.csr_array  # (W, J)
    placement: np.ndarray  # (4, 4) template to target


def weights_of(skin: viewer.Skin) -> sp.csr_array:
    """Return weights as a matrix with rows that sum to 1."""
    matrix = sp.csr_array(
        (skin.weights, skin.joints, skin.starts), shape=(skin.n_vertices, skin.n_joints)
    )
    return sp.csr_array(sp.diags_array(1.0 / matrix.sum(axis=1)) @ matrix)


def body() -> viewer.Figure:
    return viewer.load(SAMPLES / "body.npz").actors[0].figure


def fox() -> viewer.Figure:
    return viewer.load(SAMPLES / "fox.skel", SAMPLES / "fox.skin").actors[0].figure


def targets(figure: viewer.Figure, what: str) -> list[Target]:
    """Return all targets of a figure; those of the body include clothes and lowered arms."""
    rng = np.random.default_rng(20)
    plain = posed(what, figure, viewer.rest_pose(figure.skeleton))
    bent = posed(what, figure, bent_pose(figure, rng, 0.25))
    made = [
        _perturbed(plain, rng),
        subdivided(plain),
        _remeshed(plain, rng),
        _coarse_template(plain),
        _placed(_remeshed(plain, rng)),
        _named(_remeshed(bent, rng), "re-posed, remeshed"),
        _otherwise_bent(plain, figure, rng),
        _named(shell(plain, 0.01, None), "offset by 1 %"),
    ]
    if what == "body":
        down = posed(what, figure, _arms_down(figure))
        made.append(_named(_remeshed(down, rng), "arms on the torso"))
        torso = ["pelvis", "spine1", "spine2", "spine3", "left_hip", "right_hip"]
        made.append(_named(shell(plain, 0.015, torso), "clothes, open, offset by 1.5 %"))
    return made


def without_pose(figure: viewer.Figure, what: str) -> list[Target]:
    """Return posed targets for a template at rest; their positions are unknown."""
    rng = np.random.default_rng(21)
    rest = viewer.rest_pose(figure.skeleton)
    at_rest = posed(what, figure, rest)
    made = []
    for degrees in (4.0, 8.0, 15.0):
        bent = posed(what, figure, bent_pose(figure, rng, np.radians(degrees)))
        made.append(_named(_remeshed(bent, rng), f"bent by {degrees:g} degrees"))
    if what == "body":
        for angle, name in ((0.6, "arms half down"), (1.35, "arms on the torso")):
            down = posed(what, figure, _arms_down(figure, angle))
            made.append(_named(_remeshed(down, rng), name))
    return [replace(each, pose=rest, template=at_rest.positions) for each in made]


def stretched(figure: viewer.Figure, what: str) -> list[Target]:
    """Return targets with a different scale along each axis, which no pose can match."""
    rng = np.random.default_rng(22)
    plain = posed(what, figure, viewer.rest_pose(figure.skeleton))
    made = []
    for factors in ((1.05, 1.0, 1.1), (1.2, 1.0, 0.9), (1.3, 1.0, 0.8)):
        target = _remeshed(plain, rng)
        name = "stretched by " + ", ".join(f"{factor:g}" for factor in factors)
        made.append(replace(target, name=name, positions=target.positions * factors))
    cosine, sine = np.cos(TURN), np.sin(TURN)
    turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    turned = made[1].positions @ turn.T
    return [*made, replace(made[1], name=f"{made[1].name}, turned", positions=turned)]


def fine(figure: viewer.Figure) -> Target:
    """Return a target of more than 50,000 vertices, part of which does not match."""
    rest = posed("", figure, viewer.rest_pose(figure.skeleton))
    bent = _otherwise_bent(rest, figure, np.random.default_rng(3), remesh=False)
    return clustered(subdivided(subdivided(bent)), 0.3 * edge_length(*_surface(rest)))


def template_figure(target: Target) -> viewer.Figure:
    """Return the template of a target as a figure, with weights that sum to 1."""
    figure = target.figure
    if len(target.template) == figure.mesh.n_vertices:
        return figure
    # A decimated template keeps some vertices of the figure, which are found by their rest
    # positions.
    rest = viewer.deform(figure, target.pose, viewer.Skinning(correctives=False))[0]
    kept = cKDTree(rest).query(target.template)[1]
    positions = figure.mesh.positions[kept]
    entries = sp.coo_array(target.template_weights)
    skin = skin_from_entries(
        len(target.template), entries.row, entries.col, entries.data, figure.skin.inverse_bind
    )
    normals = vertex_normals(positions, target.template_triangles)
    mesh = viewer.Mesh(positions, normals, target.template_triangles)
    return viewer.Figure(figure.name, mesh, figure.skeleton, skin, up=figure.up)


def _surface(target: Target) -> tuple[np.ndarray, np.ndarray]:
    return target.positions, target.triangles


def posed(what, figure, pose) -> Target:
    """Return the vertices of a figure in a pose."""
    positions, _ = viewer.deform(figure, pose, viewer.Skinning(correctives=False))
    weights, triangles = weights_of(figure.skin), figure.mesh.triangles
    return Target(
        what, figure, pose, positions, triangles, weights, positions, triangles, weights, np.eye(4)
    )


def _named(target: Target, name: str) -> Target:
    return replace(target, name=name)


def bent_pose(figure, rng, angle: float) -> viewer.Pose:
    """Rotate all joints except the root about random axes by normally distributed angles."""
    pose = viewer.rest_pose(figure.skeleton)
    turns = rng.normal(scale=angle / np.sqrt(3), size=(len(pose.rotations), 3))
    turns[0] = 0.0
    turn_joints(pose, turns)
    return pose


def _arms_down(figure, angle: float = 1.35) -> viewer.Pose:
    """Lower the arms of the body; by default until they touch the torso."""
    pose = viewer.rest_pose(figure.skeleton)
    turns = np.zeros((len(pose.rotations), 3))
    names = list(figure.skeleton.names)
    turns[names.index("left_shoulder"), 2] = -angle
    turns[names.index("right_shoulder"), 2] = angle
    turn_joints(pose, turns)
    return pose


def turn_joints(pose: viewer.Pose, vectors: np.ndarray) -> None:
    """Rotate each joint by its rotation vector, in place."""
    angles = np.linalg.norm(vectors, axis=1, keepdims=True)
    axes = vectors / np.where(angles > 0, angles, 1.0)
    pose.rotations[:] = np.concatenate([np.sin(angles / 2) * axes, np.cos(angles / 2)], axis=1)


def edges(triangles: np.ndarray) -> np.ndarray:
    """Return each edge once: (E, 2)."""
    return np.unique(np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)


def edge_length(positions, triangles) -> float:
    """Return the median length of the edges."""
    links = edges(triangles)
    return float(np.median(np.linalg.norm(np.diff(positions[links], axis=1), axis=2)))


def size_of(positions) -> float:
    return float(np.linalg.norm(np.ptp(positions, axis=0)))


def _perturbed(target: Target, rng) -> Target:
    step = 0.2 * edge_length(target.positions, target.triangles)
    positions = target.positions + rng.normal(scale=step / 2, size=target.positions.shape)
    return replace(target, name="perturbed", positions=positions)


def subdivided(target: Target) -> Target:
    """Add a vertex at the middle of each edge, with the mean of the weights at its ends."""
    links, count = edges(target.triangles), len(target.positions)
    keys = links[:, 0].astype(np.int64) * count + links[:, 1]
    a, b, c = target.triangles.T.astype(np.int64)

    def middle(i, j):
        low, high = np.minimum(i, j), np.maximum(i, j)
        return count + np.searchsorted(keys, low * count + high)

    ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
    triangles = np.concatenate(
        [np.stack(three, axis=1) for three in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    )
    rows = np.concatenate([np.arange(count), np.repeat(count + np.arange(len(links)), 2)])
    columns = np.concatenate([np.arange(count), links.ravel()])
    shares = np.concatenate([np.ones(count), np.full(2 * len(links), 0.5)])
    means = sp.csr_array((shares, (rows, columns)), shape=(count + len(links), count))
    return replace(
        target,
        name="subdivided",
        positions=means @ target.positions,
        triangles=triangles.astype(np.int32),
        weights=sp.csr_array(means @ target.weights),
    )


def clustered(target: Target, cell: float) -> Target:
    """Keep one vertex per grid cell: the one nearest to the mean of the cell's vertices."""
    cells = np.floor(target.positions / cell).astype(np.int64)
    _, label = np.unique(cells, axis=0, return_inverse=True)
    label = label.ravel()
    counts = np.bincount(label)
    means = np.stack(
        [np.bincount(label, target.positions[:, axis]) / counts for axis in range(3)], axis=1
    )
    far = np.linalg.norm(target.positions - means[label], axis=1)
    order = np.lexsort((far, label))
    kept = order[np.unique(label[order], return_index=True)[1]]
    triangles = label[target.triangles]
    whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    triangles = triangles[whole]
    once = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)[1]
    return replace(
        target,
        name="decimated",
        positions=target.positions[kept],
        triangles=triangles[np.sort(once)].astype(np.int32),
        weights=target.weights[kept],
    )


def _remeshed(target: Target, rng) -> Target:
    """Subdivide twice, keep about as many vertices at different positions, then perturb."""
    fine = subdivided(subdivided(target))
    coarse = clustered(fine, 1.1 * edge_length(target.positions, target.triangles))
    return replace(_perturbed(coarse, rng), name="remeshed")


def _coarse_template(target: Target) -> Target:
    """Use a decimated template with its weights in place of the figure."""
    coarse = clustered(target, 2.0 * edge_length(target.positions, target.triangles))
    return replace(
        target,
        name="coarse template",
        template=coarse.positions,
        template_triangles=coarse.triangles,
        template_weights=coarse.weights,
    )


def _placed(target: Target) -> Target:
    """Rotate, scale to centimetres and translate target and template."""
    cosine, sine = np.cos(TURN), np.sin(TURN)
    matrix = np.eye(4)
    matrix[:3, :3] = 95.0 * np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
    matrix[:3, 3] = 30.0, -12.0, 400.0

    def move(points):
        return points @ matrix[:3, :3].T + matrix[:3, 3]

    return replace(
        target,
        name="remeshed, turned, in centimetres",
        positions=move(target.positions),
        template=move(target.template),
        placement=matrix,
    )


def _otherwise_bent(target: Target, figure, rng, remesh: bool = True) -> Target:
    """Bend the target slightly but not the template, as in an imperfect fit of the pose."""
    bent = posed("", figure, bent_pose(figure, rng, np.radians(4.0)))
    bent = _remeshed(bent, rng) if remesh else bent
    return replace(bent, name="bent by 4 degrees", template=target.template, pose=target.pose)


def shell(target: Target, offset: float, joints: list[str] | None) -> Target:
    """Offset the surface along its normals, only in the parts of the given joints if any."""
    normals = vertex_normals(target.positions, target.triangles)
    links = edges(target.triangles)
    both = np.concatenate([links, links[:, ::-1]])
    count = len(normals)
    matrix = sp.csr_array((np.ones(len(both)), (both[:, 0], both[:, 1])), shape=(count, count))
    for _ in range(5):
        normals = normals + matrix @ normals
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    moved = target.positions + offset * size_of(target.positions) * normals
    triangles = target.triangles
    if joints is not None:
        names = list(target.figure.skeleton.names)
        inside = np.isin(target.weights.toarray().argmax(axis=1), [names.index(n) for n in joints])
        triangles = triangles[inside[triangles].all(axis=1)]
    used, flat = np.unique(triangles, return_inverse=True)
    part = replace(
        target,
        positions=moved[used],
        triangles=flat.reshape(-1, 3).astype(np.int32),
        weights=target.weights[used],
    )
    return clustered(subdivided(part), 1.1 * edge_length(part.positions, part.triangles))
