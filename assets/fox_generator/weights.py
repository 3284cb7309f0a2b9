"""Skin weights by heat diffusion over the surface, which does not cross gaps.

Baran and Popovic 2007, "Automatic Rigging and Animation of 3D Characters", section 4:
(-Laplacian + H) w = H p, with p = 1 at the joint nearest to a vertex and H = 1 / distance^2.
"""

import numpy as np
from generator_tools.diffusion import cotangent_stiffness, segment_distances
from generator_tools.shapes import Floats
from scipy.sparse import diags
from scipy.sparse.linalg import splu

from .body import REGIONS, regions
from .skeleton import Joint, segments

CONTRAST = 1.3  # exponent that attenuates the long tails of the diffusion
INNER_LEG = 0.022  # distance in metres from the midline at which legs begin
SMALLEST = 0.006  # weights below this are dropped
# Blending distance between the joints of a region, in limb radii.
SPREAD = {"torso": 0.75, "neck": 0.8, "head": 0.5, "jaw": 0.35, "ear": 0.8, "tail": 0.8}


def _allowed(vertices: Floats, table: list[Joint]) -> np.ndarray:
    """Return a mask (V, J) of the joints that may influence a vertex: same region, same side."""
    own = np.array(REGIONS)[regions(vertices)]
    # Between the legs, the underside of the trunk is nearer to the shapes of the legs than to the
    # trunk's.
    own[np.isin(own, ("fore", "hind")) & (np.abs(vertices[:, 0]) < INNER_LEG)] = "torso"
    allowed = own[:, None] == np.array([joint.region for joint in table])
    side = np.array([joint.name[-2:] for joint in table])
    allowed &= ~((side == "_l") & (vertices[:, :1] <= 0))
    allowed &= ~((side == "_r") & (vertices[:, :1] >= 0))
    return allowed


def diffuse_weights(vertices: Floats, triangles: np.ndarray, table: list[Joint]) -> Floats:
    """Return weights (V, J) that sum to 1, for a closed mesh of vertices welded at seams."""
    reach = segment_distances(vertices, *segments(table))
    allowed = _allowed(vertices, table)
    # A midline vertex in a paired region is assigned to the nearest joint on the midline.
    alone = ~allowed.any(axis=1)
    allowed[alone] = [joint.name[-2:] not in ("_l", "_r") for joint in table]
    owner = np.where(allowed, reach, np.inf).argmin(axis=1)
    radius = reach[np.arange(len(vertices)), owner]
    spread = np.array([SPREAD.get(joint.region, 0.7) for joint in table])[owner]
    stiffness, areas = cotangent_stiffness(vertices, triangles)
    heat = areas / (spread * np.maximum(radius, 0.004)) ** 2
    source = np.zeros_like(reach)
    source[np.arange(len(vertices)), owner] = heat
    weights = np.asarray(splu((stiffness + diags(heat)).tocsc()).solve(source))
    weights = np.maximum(weights, 0) ** CONTRAST
    weights /= weights.sum(axis=1, keepdims=True)
    weights[weights < SMALLEST] = 0
    return weights / weights.sum(axis=1, keepdims=True)
