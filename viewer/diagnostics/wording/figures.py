"""Messages about parts of figures: weights, bind matrices, skeletons, meshes, symmetry."""

from viewer.diagnostics.codes import Code

CODES = {
    # Weights
    "W001": Code(
        "warning",
        "weights do not sum to 1",
        "normalise them ({window:?Normalise weights in the Skinning panel|--normalize} shows the "
        "effect)",
    ),
    "W002": Code("warning", "negative weights", "set them to 0 and normalise"),
    "W003": Code("error", "non-finite weights", "paint or copy these weights again"),
    "W004": Code(
        "warning", "vertices without influence", "give them the weights of their neighbours"
    ),
    "W005": Code("error", "island without weights", "bind it rigidly to one joint"),
    "W006": Code("note", "joints without influence", "none if they are helpers"),
    "W007": Code(
        "note", "more than 4 influences", "prune and normalise for engines that support only 4"
    ),
    "W008": Code(
        "note", "more than 8 influences", "prune and normalise for engines that support only 8"
    ),
    "W009": Code("note", "duplicate influences", "merge them"),
    "W010": Code(
        "error", "weight refers to a nonexistent joint", "add the joint or correct the index"
    ),
    # Bind matrices
    "B001": Code(
        "error", "bindings do not match the skeleton", "export skin and skeleton together"
    ),
    "B002": Code("error", "singular bind matrix", "rebind this joint without a zero scale"),
    "B003": Code("warning", "ill-conditioned bind matrix", "rebind this joint"),
    "B004": Code("note", "bind pose differs from the rest pose", "none if intentional"),
    "B005": Code(
        "warning", "reflected bind matrix", "freeze the negative scale and rebind this joint"
    ),
    "B006": Code("error", "non-affine bind matrix", "set its last row to 0 0 0 1"),
    # Skeletons and their limits
    "S001": Code("error", "parent after its child", "list parents before their children"),
    "S002": Code("error", "cyclic hierarchy", "give one of these joints another parent"),
    "S003": Code("error", "limit with minimum above maximum", "swap the two values"),
    "S004": Code("warning", "pose outside its limits", "widen the limit or change the pose"),
    "S005": Code("note", "locked DOFs", "none if these joints should not move"),
    "S006": Code(
        "warning", "duplicate joint names", "rename them: many programs match joints by name"
    ),
    "S007": Code("warning", "unnamed joints", "name them: many programs match joints by name"),
    "S008": Code(
        "note", "multiple roots", "give them a common parent for programs that expect a single root"
    ),
    "S009": Code("warning", "non-unit rest rotation", "normalise the quaternion"),
    "S010": Code("warning", "non-positive rest scale", "freeze the scale of this joint"),
    # Meshes and their symmetry
    "M001": Code("warning", "degenerate triangles", "merge their corners or delete them"),
    "M002": Code("warning", "flipped triangles", "reverse their winding"),
    "M003": Code("warning", "inside-out mesh", "reverse the winding of all its triangles"),
    "M004": Code("note", "unused vertices", "delete them unless they are referenced elsewhere"),
    "M005": Code("note", "open boundaries", "close them if the mesh is meant to be solid"),
    "M006": Code("warning", "non-manifold edges", "split the parts that meet there"),
    "M007": Code("warning", "zero-length normals", "recompute the normals"),
    "M008": Code("warning", "non-unit normals", "normalise them"),
    "M009": Code(
        "warning", "normals opposite to the winding", "reverse the normals or the winding"
    ),
    "M010": Code("warning", "stray vertices", "move or delete them"),
    "M011": Code("warning", "duplicate triangles", "delete the copies"),
    "M012": Code("warning", "non-orientable surface", "cut it where the winding reverses"),
    "Y001": Code("warning", "asymmetric positions", "mirror one side"),
    "Y002": Code("warning", "asymmetric weights", "mirror the weights of one side"),
}

MESSAGES = {
    # Weights
    "W001.sums": "weights of {n:#vertex} do not sum to 1 (worst: {sum:.6g} at vertex {vertex}, an "
    "error of {error:.3g})",
    "W002.negative": "{n:#negative weight} (first: {weight:.6g} at vertex {vertex} for joint "
    "{joint:text})",
    "W004.vertices": "{n:#vertex|has|have} no influence and {n:?stays|stay} in the bind pose "
    "(first: vertex {vertex})",
    "W005.islands": "{n:#island} with {n_vertices:#vertex} {n:?has|have} no weights and "
    "{n:?stays|stay} in the bind pose (first: at vertex {vertex})",
    "W006.joints": "{n:#joint|has|have} no influence: {names:list}",
    "W007.influences": "{n:#vertex|has|have} more than 4 influences (maximum: {most}){cost:+; {}}",
    "W008.influences": "{n:#vertex|has|have} more than 8 influences (maximum: {most}){cost:+; {}}",
    "W009.joints": "{n:#vertex|lists|list} a joint more than once (first: vertex {vertex})",
    # Bind matrices
    "B002.singular": "{n:#bind matrix/{all}|is|are} singular: {names:list} (determinant "
    "{value:z.3g})",
    "B003.ill-conditioned": "{n:#bind matrix/{all}|is|are} ill-conditioned: {names:list} "
    "(condition number {value:.3g})",
    "B004.joints": "{n:#joint|has a bind pose that differs|have bind poses that differ} from the "
    "rest pose (worst: {joint:text} by {distance}): the mesh is deformed at rest",
    "B005.reflected": "{n:#bind matrix/{all}|is|are} reflected: {names:list} (determinant "
    "{value:.3g})",
    "B006.not-affine": "{n:#bind matrix/{all}|is|are} not affine: {names:list} (error {value:.3g})",
    # Skeletons and their limits
    "S004.clamped": "{n:#DOF} clamped: {dof}",
    "S004.pose": "{n:#DOF} of the pose {n:?is outside its|are outside their} limits: {dof}",
    "S005.dofs": "{n:#DOF/{all}|is|are} locked: {names:list}",
    "S006.joints": "{n:#joint} with duplicate names: {names:list}",
    "S007.joints": "{n:#joint|has|have} no name (first: joint {joint})",
    "S008.roots": "{n} joints have no parent: {names:list}",
    "S009.rotations": "{n:#rest rotation|is|are} not normalised (first: length {length:.4g} at "
    "{joint:text})",
    "S010.scales": "{n:#rest scale|is|are} not positive (first: {x:zg} {y:zg} {z:zg} at "
    "{joint:text})",
    # Meshes and their symmetry
    "M001.triangles": "{n:#triangle/{all}|has|have} zero area (first: triangle {triangle})",
    "M002.triangles": "{n:#triangle/{all}|is wound opposite to its|are wound opposite to their} "
    "neighbours (first: triangle {triangle})",
    "M003.parts": "{n:#closed part} with {n_triangles:#triangle} {n:?is|are} inside out (first: "
    "triangle {triangle})",
    "M004.vertices": "{n:#vertex/{all}|is|are} not used by any triangle (first: vertex {vertex})",
    "M005.edges": "{n:#boundary edge} (first: between vertices {vertex} and {other})",
    "M006.edges": "{n:#non-manifold edge} with up to {most} triangles (first: between vertices "
    "{vertex} and {other})",
    "M007.normals": "{n:#normal|has|have} zero length (first: vertex {vertex})",
    "M008.normals": "{n:#normal|is|are} not unit length (worst: {length:.4g} at vertex {vertex})",
    "M009.normals": "{n:#normal/{all}|opposes|oppose} the winding of all adjacent triangles "
    "(first: vertex {vertex})",
    "M010.vertices": "{n:#stray vertex} (worst: vertex {vertex}, {ratio:.2g} times the typical "
    "distance from the centre)",
    "M011.triangles": "{n:#duplicate triangle} (first: triangle {triangle})",
    "M012.surface": "non-orientable surface of {n:#triangle} (at triangle {triangle})",
    "Y001.positions": "{n:#vertex|is not at the mirrored position of its counterpart|are not at "
    "the mirrored positions of their counterparts} (worst: {distance} at vertex {vertex})",
    "Y002.weights": "weights of {n:#vertex} differ from those of {n:?its mirror counterpart|their "
    "mirror counterparts} (worst: total difference {difference:.3g} at vertex {vertex})",
}

PHRASES = {
    # Weights
    "cut-cost": "pruning to {limit} moves the mesh by up to {most} (vertex {vertex}), {mean} on "
    "average over these vertices, in {poses:#pose}{left_out:+; {}}",
    "cut-cost-unknown": "the effect of pruning to {limit} is unknown: {left_out}",
    "cut-cost-left-out": "{n:#vertex|is|are} omitted because a required position or bind matrix is "
    "invalid",
    # Skeletons and their limits
    "repeated-name": "{name:quoted} ({n})",
    "beyond-limits": "{dof:text} is {value}{when}; its limits are {low} and {high}",
    "below-minimum": "{dof:text} is {value}{when}; its minimum is {low}",
    "above-maximum": "{dof:text} is {value}{when}; its maximum is {high}",
    "in-frame": " in frame {frame} at {time:z.3f} s",
}
