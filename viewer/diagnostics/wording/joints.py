"""Messages about the joints of ``.skel`` and ``.bvh`` files."""

MESSAGES = {
    "F002.opening": '{item}: expected "{{", found {found:quoted}',
    "F002.joint-open": 'expected "}}" to close {joint} (line {line}), found {found:quoted}',
    "F006.extra-braces": 'ignored {n} "}}" after the root',
    # .skel
    "F002.no-joint": "expected a skeleton, found no balljoint{looks:+ ({})}",
    "S003.ignored": "ignored {n:#limit} with minimum above maximum (first: rot{axis}limit {low:g} "
    "{high:g} of {joint})",
    "F002.skel-none": "figure {figure:text} has no skeleton to write as .skel",
    "F002.skel-rest": ".skel cannot store joints with a rest rotation or scale",
    "F002.skel-dofs": ".skel can store only rotations about x, y and z as DOFs",
    "F002.skel-root": ".skel cannot store a root translation in the pose, or its limits",
    "F002.skel-limits": ".skel treats limits beyond ±{most:.0f} as unlimited",
    "F002.skel-numbers": ".skel cannot store numbers beyond ±{most:.3g}",
    "F002.skel-order": ".skel lists joints depth-first; joint {joint:text} is out of order",
    "F002.skel-name": '.skel cannot store the joint name "{name:text}"',
    # .bvh
    "F002.bvh-start": "expected HIERARCHY, found {found:quoted}{looks:+ ({})}",
    "F002.bvh-no-root": "expected ROOT, found {found:quoted}",
    "F002.bvh-root": "expected ROOT or MOTION, found {found:quoted}",
    "F002.bvh-item": "{joint}: expected OFFSET, CHANNELS, JOINT, End Site or "
    '"}}", found {found:quoted}',
    "F002.bvh-end-item": '{joint}: expected OFFSET or "}}", found {found:quoted}',
    "F002.bvh-offset-again": "{joint}: expected one OFFSET, found a second one",
    "F002.bvh-channels-again": "{joint}: expected one CHANNELS, found a second one",
    "F002.bvh-channel": "{item}: expected a channel name (Xposition … Zrotation), found "
    "{found:quoted}",
    "F002.bvh-position-again": "{item}: expected each position channel once, found {found:quoted} "
    "again",
    "F002.bvh-channel-count": "{item}: expected {expected:#channel name}, found {found}",
    "F007.bvh-no-offset": "{joint} has no OFFSET: 0 0 0 assumed",
    "F006.bvh-offset": "OFFSET: expected 3 numbers, found 6 in {n:#joint} (first: {joint}); the "
    "last 3 are ignored",
    "F006.bvh-end-channels": "ignored CHANNELS in {joint}",
}

PHRASES = {
    "joint": "joint {name:name}",
    "unnamed-joint": "unnamed joint",
    "end-site": "End Site of {joint}",
    "of": "{item} of {owner}",
}
