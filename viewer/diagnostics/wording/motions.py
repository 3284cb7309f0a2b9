"""Messages about clips and captured motions, their transfer to figures, and their clean-up."""

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

_MOVED = "{part} move by {mean} on average, by {largest} at most{where:+ ({})}"

MESSAGES = {
    # Clips, keypoints and feet
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
    # Poses and motions applied to figures
    "F004.body-joint": "{motion:text} moves the joint {joint:text}, which {figure:text} does not "
    "have",
    "F004.no-skeleton": "{figure:text} has no skeleton to animate",
    "F004.mirror": "figure {figure:text} has no skeleton to mirror",
    "F004.mapping-joint": "expected a joint of {figure:text}, found {joint:quoted}; {near}",
    "F004.mapping-joints": "expected one joint of {figure:text}, found {joint:quoted}, a name "
    "shared by {n}; {near}",
    "F004.mapping-again": "expected each joint of {figure:text} at most once, found {joint:quoted} "
    "again",
    "F004.joints-unmatched": "{motion:text} does not match {figure:text}: expected hips and a leg "
    "or an arm in both, found {n:#matching joint}; not recognised in {motion:text}: "
    "{unused:list}; in {figure:text}: {idle:list}; match them "
    "{window:?in the Joint match panel|in the Joint match panel or with --joint-map}",
    "F004.no-common-joint": "{pose:text} and {figure:text} have no joint names in common",
    "F004.rest-frame": "--source-rest: expected a frame from {first} to {last} with a pose, found "
    "{found}",
    "F004.asymmetric": "{joint:text} has no mirror counterpart: the skeleton is not symmetric",
    "F007.coefficient-left-out": "{group} coefficient {last} omitted (largest value "
    "{largest:.3g}): {figure:text} has {most}",
    "F007.coefficients-left-out": "{group} coefficients {first} to {last} omitted (largest value "
    "{largest:.3g}): {figure:text} has {most}",
    "F007.joints-left-out": "{n:#joint} missing from {figure:text} omitted: {names:list}",
    "F007.hand-left-out": "{side} hand omitted: {figure:text} has no hand components",
    "F007.hand-components-left-out": "hand components beyond the {most} of {figure:text} omitted",
    "F007.joints-matched": "{motion:text} drives {n} of {all} joints of {figure:text}",
    "F007.joints-matched-as-follows": "{motion:text} drives {n} of {all} joints of {figure:text}: "
    "{pairs:list}",
    "F007.joints-at-rest": "joints kept at rest: {names:list12}",
    "C018.limbs-unmatched": "{names:list} of {figure:text} {n:?stays|stay} at rest: nothing in "
    "{motion:text} is recognised as {n:?this joint|these joints} (unused: {unused:list}); match "
    "{n:?it|them} in the Joint match panel{window:?| or with --joint-map}",
    "C018.limbs-unknown": "no joint of {figure:text} is recognised as {parts:or}: {motion:text} "
    "cannot move {n:?it|them} (at rest: {idle:list}); match {n:?it|them} in the Joint match panel"
    "{window:?| or with --joint-map}",
    "C018.limbs-still": "{names:list} of {figure:text} never bend, because {partners:list} of "
    "{motion:text} never do; if this is wrong, match other joints in the Joint match panel"
    "{window:?| or with --joint-map}",
    "F007.joints-without-partner": "joints of {motion:text} that drive nothing: {names:list12}",
    "F007.rest-asked": "rest pose of {motion:text}: frame {frame}, as requested",
    "F007.rest-frame": "rest pose of {motion:text}: frame {frame}, {pose}, because its zero pose "
    "is not a standing pose{window:?| (--source-rest overrides it)}",
    "F007.rest-anatomy": "rest pose of {motion:text}: estimated from trunk, soles, knees and "
    "elbows, because neither its zero pose nor any frame is a T- or A-pose"
    "{window:?| (--source-rest overrides it)}",
    "F007.rest-axes": "rest pose of {motion:text}: a T-pose, in which its joint axes are parallel "
    "to the body's, because its zero pose is not a standing pose"
    "{window:?| (--source-rest overrides it)}",
    "F007.rest-straight": "roll assumed for limbs of {motion:text} that hardly bend: {names:list}",
    "F007.rest-lying": "rest pose of {motion:text}: estimated from trunk, knees and elbows, with "
    "an assumed slope of the feet, because the person never stands"
    "{window:?| (--source-rest overrides it)}",
    "F007.feet-planted": "feet of {figure:text} planted during {n:#contact}: they slide by {after} "
    "instead of {before} ({source} in {motion:text}); "
    "{window:?Feet on the ground in the Actors panel|--feet off} disables this",
    "F007.feet-gap": "soles of {figure:text} are at most {gap} from the ground during contacts, "
    "instead of {gap_before}",
    "F007.feet-lowered": "{figure:text} is lowered by up to {length}, so that its feet reach "
    "the ground",
    "F007.feet-ground": "ground moves at {speed}, as on a treadmill: planted feet of {figure:text} "
    "move with it",
    "F007.feet-kept": "feet of {figure:text} not planted: they already slide as little as "
    "those of {motion:text}",
    "F007.feet-no-contacts": "feet of {figure:text} not planted: no ground contacts found in "
    "{motion:text}",
    "F007.path-scaled": "path of the root scaled by {scale:.3g}, {by}",
    "F007.joint-positions-left-out": "translations of {n:#joint} relative to {n:?its parent|their "
    "parents} omitted (largest: {most:.3g} at {joint:text})",
    "F007.joints-taken-over": "transferred {n} of {all} joints of {figure:text}",
    "F007.joints-lacking": "{figure:text} has no joint named {names:list12}",
    "F007.joints-limited": "rotated as far as DOFs and limits allow: {names:list12}",
    "F007.left-as-they-were": "unchanged: {names:list}",
    "F007.scale-kept": "{fault}; kept at {scale:g}",
    "F007.translation-kept": "{fault}; unchanged",
    "F007.pose-clamped": "{n:#DOF} of the pose clamped to {n:?its|their} limits",
    "F007.pose-joints-left-out": "{n:#joint} of the pose omitted: missing from {figure:text}",
    "F007.body-joints-left-out": "{n:#joint} in the pose beyond the body's {own} omitted",
    "F007.part-left-out": "{part} omitted: {figure:text} has no such joint",
    "F007.hand-part-left-out": "{part} omitted: {figure:text} has no hand components",
    # Clean-up of captured motions
    "X006.smoothed": f"{{figure:text}}: smoothed ({{filter}}): {_MOVED}",
    "X006.gaps": "{figure:text}: {n:#missing frame} in {gaps:#gap} interpolated; the longest is "
    "{longest} ({seconds:.2g} s)",
    "X006.gaps-left": "{figure:text}: {n:#gap} longer than {limit:#frame} {n:?remains|remain}: "
    "{gaps:list}",
    "X006.locked": "{figure:text}: feet held in place in {n:#contact}, so they slide by {after} "
    f"instead of {{before}}: {_MOVED}",
    "X006.locked-lowered": "{figure:text}: lowered by up to {length}, so that its feet reach "
    "the ground",
    "X006.locked-glides": "{figure:text}: feet not held in {n:#more contact}, in which they glide "
    "too far",
    "X006.no-contacts": "{figure:text}: no foot is held, because none rests on the ground",
    "X006.only-glides": "{figure:text}: feet not held, because they glide too far in "
    "{n:#contact} with the ground",
    "X006.no-legs": "{figure:text}: feet not held, because no joint has the name of a leg",
    "X006.grounded": "{figure:text}: {way} by {height}, so that its feet rest at height 0",
    "X006.grounded-lowest": "{figure:text}: {way} by {height}, so that the lowest position of its "
    "feet is at height 0 (they never clearly rest)",
    "X006.no-feet": "{figure:text}: not moved to the ground, because it has neither feet with a "
    "mesh nor joints of known names",
    "X006.trimmed": "{figure:text}: frames {first} to {last} kept, {n} of {all}",
    "X006.resampled": "{figure:text}: resampled from {old:g} to {new:g} fps, {before:#frame} to "
    f"{{after}}: at the times of the original frames, {_MOVED}",
    "X006.merged": "{other}: {n:#frame} joined to {kept}",
    "X006.renumbered": "{part} of {other} assigned to {kept}",
    "X006.overlap": "{other} and {kept} are both present in {n:#frame} ({frames:list}), {distance} "
    "apart: the frames of {kept} are used",
    "X006.keys": "{figure:text}: its motion has keys instead of captured frames and is unchanged",
}

PHRASES = {
    # Clips, keypoints and feet
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
    # Poses and motions applied to figures
    "the-pose": "the pose",
    "two-joints": "two joints",
    "joint-by-joint": "{joint:text} by {partner:text}",
    "ratio-of-legs": "the ratio of leg lengths",
    "ratio-of-arms": "the ratio of arm lengths",
    "ratio-of-bones": "the ratio of bone lengths",
    "ratio-of-nothing": "because no lengths can be compared",
    "left-moves": "joint translations",
    "left-place": "figure translation",
    "left-size": "figure scale",
    "left-scales": "joint scales",
    "left-shape": "figure shape",
    "t-pose": "a T-pose",
    "a-pose": "an A-pose",
    "scale-not-positive": "scale: expected a positive number, found {found:g}",
    "scale-out-of-range": "scale: expected {low:g} to {high:g}, found {found:g}",
    "translation-too-far": "translation: expected at most {most:g}, found {found:g}",
    # Clean-up of captured motions
    "one-euro": "One Euro filter, cutoff {cutoff:g} Hz, beta {beta:g}",
    "savgol": "Savitzky-Golay filter, {shortest:+{} to }{n:#frame}, degree {order}{left:+; {}}",
    "savgol-short": "{n:#run} with too few frames {n:?is|are} unchanged",
    "moved-joints": "joints",
    "moved-points": "points",
    "part-body": "body",
    "part-points": "keypoints",
    "raised": "raised",
    "lowered": "lowered",
    "joint-in-frame": "{joint:text}, frame {frame}",
}
