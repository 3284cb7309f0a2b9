"""Messages about poses and motions that figures take over."""

MESSAGES = {
    "F007.coefficient-left-out": "{group} coefficient {last} was left out, as {figure:text} has "
    "{most} (largest {largest:.3g})",
    "F007.coefficients-left-out": "{group} coefficients {first} to {last} were left out, as "
    "{figure:text} has {most} (largest {largest:.3g})",
    "F007.joints-left-out": "{n:#joint} that {figure:text} lacks {n:?was|were} left out: "
    "{names:list}",
    "F007.hand-left-out": "the {side} hand: {figure:text} has no hand components",
    "F007.hand-components-left-out": "hand components beyond the {most} of {figure:text} were "
    "left out",
    "F007.joints-matched": "{motion:text} moves {n} of {all} joints of {figure:text}",
    "F007.joints-matched-as-follows": "{motion:text} moves {n} of {all} joints of {figure:text}: "
    "{pairs:list60}",
    "F007.joints-at-rest": "at rest, as nothing moves them: {names:list60}",
    "F007.joints-without-partner": "joints of {motion:text} without a partner: {names:list60}",
    "F007.path-scaled": "its path is scaled by {scale:.4g}, the ratio of {by}",
    "F007.joint-positions-left-out": "positions of {n:#joint} within {n:?its parent|their "
    "parents} were left out, up to {most:.3g} ({joint:text})",
    "F007.joints-taken-over": "{n} of {all} joints of {figure:text} taken over",
    "F007.joints-lacking": "{figure:text} has no joint called {names:list12}",
    "F007.joints-limited": "turned as far as their DOFs and limits allow: {names:list12}",
    "F007.left-as-they-were": "left as they were: {names:list}",
    "F007.scale-kept": "{fault}; left at {scale:g}",
    "F007.translation-kept": "{fault}; left as it was",
    "F007.pose-clamped": "{n:#DOF} of the pose {n:?was beyond its|were beyond their} limits and "
    "clamped",
    "F007.pose-joints-left-out": "{n:#joint} of the pose that {figure:text} lacks {n:?was|were} "
    "left out",
    "F007.body-joints-left-out": "{n:#joint} of the pose beyond the body's {own} {n:?was|were} "
    "left out",
    "F007.part-left-out": "{part}: {figure:text} has no such joint, left out",
    "F007.hand-part-left-out": "{part}: {figure:text} has no hand components, left out",
}

PHRASES = {
    "joint-by-joint": "{joint:text} by {partner:text}",
    "ratio-of-legs": "legs",
    "ratio-of-arms": "arms",
    "ratio-of-bones": "bones",
    "ratio-of-nothing": "nothing",
    "left-moves": "where joints are moved to",
    "left-place": "the figure's place",
    "left-size": "its size",
    "left-shape": "its shape",
    "scale-not-positive": "scale: expected more than 0, found {found:g}",
    "scale-out-of-range": "scale: expected {low:g} to {high:g}, found {found:g}",
    "translation-too-far": "translation: expected at most {most:g}, found {found:g}",
}
