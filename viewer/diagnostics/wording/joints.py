"""Messages about joints as ``.skel`` and ``.bvh`` files list them."""

MESSAGES = {
    "F002.opening": '{item}: expected "{{", found {found:quoted}',
    "F002.joint-open": 'expected "}}", found {found:quoted}: {joint} (line {line}) is still open',
    "F006.extra-braces": 'ignored {n} "}}" after the root',
    # .skel
    "F002.no-joint": "expected a skeleton, found no balljoint{looks:+ ({})}",
    "S003.ignored": "ignored {n:#limit} whose minimum is above the maximum, first "
    "rot{axis}limit {low:g} {high:g} of {joint}",
    "F002.skel-none": "figure {figure:text} has no skeleton to write as .skel",
    "F002.skel-rest": ".skel cannot hold joints with a rest rotation or scale",
    "F002.skel-dofs": ".skel holds the DOFs x, y, z of each joint, no others",
    "F002.skel-root": ".skel cannot hold a translation of the root in its pose, nor limits of one",
    "F002.skel-limits": ".skel takes limits beyond +-{most:.0f} for none",
    "F002.skel-numbers": ".skel cannot hold numbers beyond {most:.3g}",
    "F002.skel-order": ".skel lists joints depth-first; joint {joint:text} comes too late",
    "F002.skel-name": '.skel cannot hold the joint name "{name:text}"',
    # .bvh
    "F002.bvh-start": "expected HIERARCHY, found {found:quoted}{looks:+ ({})}",
    "F002.bvh-no-root": "expected ROOT, found {found:quoted}",
    "F002.bvh-root": "expected ROOT or MOTION, found {found:quoted}",
    "F002.bvh-item": "{joint}: expected OFFSET, CHANNELS, JOINT, End Site or "
    '"}}", found {found:quoted}',
    "F002.bvh-end-item": '{joint}: expected OFFSET or "}}", found {found:quoted}',
    "F002.bvh-offset-again": "{joint}: expected one OFFSET, found another",
    "F002.bvh-channels-again": "{joint}: expected one CHANNELS, found another",
    "F002.bvh-channel": "{item}: expected Xposition … Zrotation, found {found:quoted}",
    "F002.bvh-position-again": "{item}: expected each position once, found {found:quoted} again",
    "F002.bvh-channel-count": "{item}: expected {expected:#channel name}, found {found}",
    "F007.bvh-no-offset": "{joint} has no OFFSET: taken for 0 0 0",
    "F006.bvh-end-channels": "ignored the channels of an {joint}",
}

PHRASES = {
    "joint": "joint {name:name}",
    "unnamed-joint": "joint without a name",
    "end-site": "End Site of {joint}",
    "of": "{item} of {owner}",
}
