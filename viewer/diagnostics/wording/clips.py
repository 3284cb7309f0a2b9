"""Messages about clips, captured points and feet."""

from viewer.diagnostics.codes import Code

CODES = {
    "C001": Code("warning", "keys out of time order", "sort the keys"),
    "C002": Code("warning", "several keys at one time", "keep one of them"),
    "C003": Code("warning", "joint jumps between frames", "look for a bad frame or a cut there"),
    "C004": Code(
        "warning", "joint rotates too fast between frames", "look for a flip of its angles"
    ),
    "C005": Code("warning", "missing frames", "interpolate them (--fill-gaps) or capture again"),
    "C006": Code("warning", "keys outside the limits", "widen the limits or move the keys"),
    "C007": Code("warning", "foot sliding", "lock the foot or move the root along"),
    "C008": Code("warning", "foot below the ground", "raise the motion or lower the ground"),
    "C009": Code("error", "clip of another skeleton", "open it with the skeleton it was made for"),
    "C010": Code("note", "clip without duration", "give it keys at two different times"),
    "C011": Code("warning", "keypoints of low confidence", "leave them out or capture again"),
    "C012": Code("note", "keypoints that are never seen", "none if the camera cannot see them"),
    "C013": Code("note", "no ground found for the feet", "give its height (--ground)"),
}

MESSAGES = {
    "C002.keys": "{n:#key|lies|lie} at the time of the one before, first in channel {channel} at "
    "{time:zg} s",
    "C003.joint": "{n:#frame/{all}}: {joint:text} moves at {speed} (limit {limit}) to frame "
    "{frame} at {time:z.3f} s",
    "C003.point": "{n:#frame/{all}}: {name:text} moves at {speed:.3g} units a second (limit "
    "{limit:.3g}) to frame {frame}",
    "C004.joint": "{n:#frame/{all}}: {joint:text} turns by {rate:.0f} degrees a second (limit "
    "{limit:.0f}) to frame {frame} at {time:z.3f} s",
    "C005.gaps": "{n:#frame/{all}|is|are} missing in {n_gaps:#gap}: {gaps:list}",
    "C006.curves": "{n:#curve|leaves its|leave their} limits: {dof}",
    "C007.foot": "{n:#frame/{all}}: {joint:text} slides by {distance} in all, at most {speed} to "
    "frame {frame}",
    "C008.foot": "{n:#frame/{all}}: {joint:text} is {depth} below the ground in frame {frame}",
    "C010.one-time": "it begins and ends at {time:zg} s",
    "C011.point": "{name:text} has a confidence below {limit:g} in {percent:.0f} % of the {n} "
    "frames that see it, first in frame {frame}",
    "C011.more-points": "{n:#more keypoint|has|have} a confidence below {limit:g}: {points:all} "
    "of the frames that see them",
    "C012.points": "{n:#keypoint/{all}|is|are} never seen: {names:list}",
    "C013.heights": "feet rest at {n:#height}, {levels:list}: it is not clear where the ground "
    "is, and they were not checked",
    "C013.no-height": "feet rest at no height for long: it is not clear where the ground is, and "
    "they were not checked",
}

PHRASES = {
    "one-frame": "frame {frame}",
    "frame-range": "frames {first} to {last}",
    "resting-height": "{height:.4g} for {seconds:.2g} s",
    "low-point": "{name:text} in {percent:.0f} %",
}
