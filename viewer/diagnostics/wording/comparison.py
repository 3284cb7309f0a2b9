"""Messages about the comparison of figures and motions."""

from viewer.diagnostics.codes import Code

CODES = {
    "D001": Code(
        "warning", "part without a counterpart", "compare files of the same figure and motion"
    ),
    "D002": Code("note", "assumption made for the comparison", "none if the assumption is correct"),
}

MESSAGES = {
    "D001.absent": "only one of the two is present in {n:#frame}",
    "D001.actor": "only in {side:text}: {actor}",
    "D001.dofs": "{n:#DOF} only in the {side}: {names:list}",
    "D001.durations": "durations differ: {first:.6g} s and {second:.6g} s",
    "D001.joints": "{n:#joint} only in the {side}: {names:list}",
    "D001.limits": "{n:#DOF|has|have} different limits, such as {dof:text}: {low:.6g} to "
    "{high:.6g} and {other_low:.6g} to {other_high:.6g}",
    "D001.mesh": "only the {side} has a mesh",
    "D001.no-motion": "the {side} has no motion",
    "D001.parents": "different parents: {names:list}",
    "D001.point-set": "only the {side} has captured points",
    "D001.points": "{n:#point} only in the {side}: {names:list}",
    "D001.skeleton": "only the {side} has a skeleton",
    "D002.dofs-by-index": "no DOF names in common: compared by index",
    "D002.joints-by-index": "no joint names in common: compared by index",
    "D002.material": "material {name:quoted} differs: {properties:list}",
    "D002.meshes": "meshes differ ({vertices:#vertex}, {triangles:#triangle}; "
    "{other_vertices:#vertex}, {other_triangles:#triangle}): closest points are compared",
    "D002.only": "{what:text} only in the {side}: {names:list}",
    "D002.order": "joints are in a different order, which matters for .skin and .anim files: where "
    "the first has {first:text}, the second has {second:text}",
    "D002.partner": "compared with {name:name}",
    "D002.points-by-index": "no point names in common: compared by index",
    "D002.rates": "frame rates differ ({first:g} and {second:g} fps): compared at the first",
    "D002.searched": "closest points computed in {n:#frame/{all}}",
    "D002.unit": "units differ ({first} and {second}): compared in {first}",
    "D002.up": "up axes differ ({first} and {second}): compared without conversion",
}

PHRASES = {
    "the-reference": "the reference",
    "lone-figure": "{name:name}",
    "lone-mesh": "{name:name} (a mesh)",
    "lone-motion": "motion {name:name}",
    "lone-points": "{name:name} (captured points)",
    "lone-skeleton": "{name:name} (a skeleton)",
}
