"""Messages about meshes and the symmetry of figures."""

from viewer.diagnostics.codes import Code

CODES = {
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

PHRASES: dict[str, str] = {}
