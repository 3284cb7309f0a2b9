"""Messages about clips, keypoints and feet."""

from viewer.diagnostics.codes import Code

CODES = {
    "C001": Code("warning", "keys out of time order", "sort the keys"),
    "C002": Code("warning", "duplicate key times", "keep one of them"),
    "C003": Code(
        "warning", "joint jumps between frames", "look for a bad frame or a cut at that time"
    ),
    "C004": Code("warning", "joint rotates too fast", "look for a flip of its Euler angles"),
    "C005": Code(
        "warning",
        "missing frames",
        "interpolate them ({window:?Interpolate gaps in the Timeline|--gaps interpolate:1s}) or "
        "record again",
    ),
    "C006": Code("warning", "keys outside the limits", "widen the limits or move the keys"),
    "C007": Code(
        "warning",
        "foot sliding",
        "lock the feet ({window:?viewer convert|--lock-feet of viewer convert})",
    ),
    "C008": Code("warning", "foot below the ground", "raise the motion or lower the ground"),
    "C009": Code("error", "clip for another skeleton", "open it with the skeleton it was made for"),
    "C010": Code("note", "zero-length clip", "add keys at different times"),
    "C011": Code("warning", "low-confidence keypoints", "omit them or record again"),
    "C012": Code("note", "keypoints that are never visible", "none if the camera cannot see them"),
    "C013": Code("note", "unclear ground height", "specify it{window:?| (--ground)}"),
    "C014": Code(
        "warning",
        "jitter",
        "smooth the motion ({window:?viewer convert|--smooth of viewer convert})",
    ),
    "C015": Code(
        "warning", "swapped IDs", "cut the motion there, or join tracks{window:?| (--merge-ids)}"
    ),
    "C016": Code(
        "warning",
        "floating feet",
        "lower the motion{window:?| (--ground)}; none if the person stands on something",
    ),
    "C017": Code(
        "warning",
        "implausible frame time",
        "write seconds, or set the rate ({window:?Frames per second in the Timeline|--fps})",
    ),
    "C018": Code(
        "warning", "limbs at rest", "match their joints ({window:?Joint match panel|--joint-map})"
    ),
    "C019": Code(
        "warning",
        "body of another model",
        "{window:?open its own model first|choose its own model (--model, --gender)}",
    ),
}

MESSAGES = {
    "C002.keys": "{n:#key|has|have} the same time as the previous key (first: channel {channel} at "
    "{time:zg} s)",
    "C003.joint": "{n:#frame/{all}}: {joint:text} moves at {speed} at frame {frame}, "
    "{time:z.3f} s (limit {limit})",
    "C003.point": "{n:#frame/{all}}: {name:text} moves at {speed:.3g} units per second at frame "
    "{frame} (limit {limit:.3g})",
    "C004.joint": "{n:#frame/{all}}: {joint:text} rotates at {rate:.0f} degrees per second at "
    "frame {frame}, {time:z.3f} s (limit {limit:.0f})",
    "C005.gaps": "{n:#frame/{all}|is|are} missing in {n_gaps:#gap}: {gaps:list}",
    "C006.curves": "{n:#curve|exceeds its|exceed their} limits: {dof}",
    "C007.foot": "{n:#frame/{all}}: {joint:text} slides by {distance} in total, at up to {speed} "
    "(frame {frame})",
    "C008.foot": "{n:#frame/{all}}: {joint:text} is {depth} below the ground at frame {frame}",
    "C009.channels": "clip {clip:text} has {n:#channel}, the skeleton {misfit}",
    "C009.rig": "clip {clip:text}: the skeleton {misfit}",
    "C010.one-time": "starts and ends at {time:zg} s",
    "C011.point": "{name:text} has a confidence below {limit:g} in {percent:.0f} % of the {n} "
    "frames in which it is visible (first: frame {frame})",
    "C011.more-points": "{n:#more keypoint|has|have} a confidence below {limit:g} in some of the "
    "frames in which they are visible: {points:all}",
    "C012.points": "{n:#keypoint/{all}|is|are} never visible: {names:list}",
    "C013.heights": "feet rest at {n:#height} ({levels:list}): ground height unclear, feet not "
    "checked",
    "C013.no-height": "feet never rest long enough at one height: ground height unclear, feet not "
    "checked",
    "C014.jitter": "{n:#frame/{all}}: {joint:text} jitters by {noise} from frame to frame, most "
    "around frame {frame} (limit {limit})",
    "C015.exchanged": "swaps positions with {other}, {distance} away, in {n:#frame}: "
    "{frames_text:list}",
    "C015.continued": "appears in frame {first}, {distance} from where {other} disappears in frame "
    "{last}: may be one person{window:?| (--merge-ids {ids} of viewer convert)}",
    "C016.foot": "{n:#frame/{all}}: both feet rest up to {height} above the ground, highest "
    "at frame {frame}",
    "C019.model": "shape coefficients of {other:text} omitted: they do not apply to {own:text} "
    "({figure:text})",
    "C019.gender": "made for a {other:text} body, but {figure:text} is {own:text}: size and shape "
    "differ from the file's",
}

PHRASES = {
    # Reasons why a clip cannot drive a skeleton, worded to follow the skeleton's name
    "clip-needs": "needs {n} (3 + 3 x {joints} joints)",
    "not-course-rig": "is not a .skel-style rig, in which clips translate the root along x, y, z "
    "and rotate each joint about x, y, z: {reason}",
    "joint-with-dofs": "joint {joint:text} has DOFs {kinds:all}",
    "joint-without-dofs": "joint {joint:text} has no DOFs",
    "dofs-unordered": "its DOFs are not in the order of its joints",
    "one-frame": "frame {frame}",
    "frame-range": "frames {first} to {last}",
    "resting-height": "{height:.3g} for {seconds:.2g} s",
    "low-point": "{name:text} in {percent:.0f} %",
}
