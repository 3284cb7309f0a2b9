"""Messages about figures in glTF and FBX files."""

MESSAGES = {
    "F002.no-figure": "expected meshes, skins or a hierarchy of nodes, found nothing to show",
    "F008.contents": "expected triangles, a skin or a hierarchy of nodes, found only "
    "{contents:list}",
    "F002.many-vertices": "expected at most {most} vertices, found {found} over all nodes",
    "F007.flat-normals": "{n:#primitive} without normals: flat shaded, with {vertices:#additional "
    "vertex} along the edges",
    "W004.mesh-node": "mesh {mesh:quoted}: {n:#vertex} without weights {n:?follows|follow} the "
    "node of the mesh instead of a joint",
    "W004.first-joint": "{n:#vertex} without weights: attached to the first listed joint",
    "F003.joint-reach": "joint {joint:quoted}: expected a rest transform within ±{limit:.2g}, "
    "found {found:.3g}",
    "F003.bind-reach": "joint {joint:quoted}: expected vertices within ±{limit:.2g} in the rest "
    "pose, found larger ones",
    "F007.animated-others": "animations of {n:#node} that {n:?belongs|belong} to no figure are "
    "omitted: {names:list}",
    "F007.orthographic": "orthographic cameras are not supported: {names:list}",
    "F007.skinning-method": "{n:?skin|skins} {names:list} {n:?asks|ask} for the method {method}: "
    "used unless {window:?the Skinning panel|--method} selects another one",
    "F007.smooth-normals": "{n:#large primitive} without normals: smoothly shaded",
    "W001.divided": "weights of {n:#vertex} do not sum to 1 (error up to {most:.2g}): divided "
    "by their sum",
}

PHRASES: dict[str, str] = {}
