"""Messages about meshes and the symmetry of figures."""

from viewer.diagnostics.codes import Code

CODES = {
    "M001": Code("warning", "degenerate triangles", "merge their corners or delete them"),
    "M002": Code("warning", "flipped triangles", "reverse their winding"),
    "M003": Code("warning", "mesh inside out", "reverse the winding of all its triangles"),
    "M004": Code("note", "unused vertices", "delete them unless something refers to them"),
    "M005": Code("note", "open boundaries", "close them if the mesh is meant to be solid"),
    "M006": Code("warning", "non-manifold edges", "split the parts that meet there"),
    "M007": Code("warning", "zero-length normals", "compute the normals again"),
    "M008": Code("warning", "normals that are not unit length", "normalise them"),
    "M009": Code(
        "warning", "normals opposite to their triangles", "reverse the normals or the winding"
    ),
    "M010": Code("warning", "stray vertices", "move or delete them"),
    "M011": Code("warning", "duplicate triangles", "delete the copies"),
    "M012": Code("warning", "non-orientable surface", "cut it where its winding reverses"),
    "Y001": Code("warning", "asymmetric positions", "mirror one side"),
    "Y002": Code("warning", "asymmetric weights", "mirror the weights of one side"),
}

MESSAGES = {
    "M001.triangles": "{n:#triangle/{all}|has|have} no area, first triangle {triangle}",
    "M002.triangles": "{n:#triangle/{all}|is wound against its|are wound against their} "
    "neighbours, first triangle {triangle}",
    "M003.parts": "{n:#closed part} with {n_triangles:#triangle} {n:?is|are} inside out, first "
    "triangle {triangle}",
    "M004.vertices": "{n:#vertex/{all}|belongs|belong} to no triangle, first vertex {vertex}",
    "M005.edges": "{n:#edge|belongs|belong} to one triangle only, first between vertices "
    "{vertex} and {other}",
    "M006.edges": "{n:#edge|belongs|belong} to more than two triangles, at most {most}, first "
    "between vertices {vertex} and {other}",
    "M007.normals": "{n:#normal|has|have} length 0, first of vertex {vertex}",
    "M008.normals": "{n:#normal|is|are} not of length 1, that of vertex {vertex} is {length:.4g} "
    "long",
    "M009.normals": "{n:#normal/{all}|points against all of its|point against all of their} "
    "triangles, first of vertex {vertex}",
    "M010.vertices": "{n:#vertex|is|are} far from the others, vertex {vertex} by {ratio:.2g} "
    "times what is usual",
    "M011.triangles": "{n:#triangle|has|have} the corners of another one, first triangle "
    "{triangle}",
    "M012.surface": "a surface of {n:#triangle} has no two sides, with triangle {triangle}",
    "Y001.positions": "{n:#vertex} {n:?is not where its partner's|are not where their partners'} "
    "mirror images are: {distance} at vertex {vertex}",
    "Y002.weights": "weights of {n:#vertex} differ from {n:?its partner's|their partners'}: by "
    "{difference:.3g} in sum at vertex {vertex}",
}

PHRASES: dict[str, str] = {}
