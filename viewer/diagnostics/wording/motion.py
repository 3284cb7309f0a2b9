"""Messages about poses and motions applied to figures."""

MESSAGES = {
    "F007.coefficient-left-out": "{group} coefficient {last} omitted (largest value "
    "{largest:.3g}): {figure:text} has {most}",
    "F007.coefficients-left-out": "{group} coefficients {first} to {last} omitted (largest value "
    "{largest:.3g}): {figure:text} has {most}",
    "F007.joints-left-out": "{n:#joint} missing from {figure:text} omitted: {names:list}",
    "F007.hand-left-out": "{side} hand omitted: {figure:text} has no hand components",
    "F007.hand-components-left-out": "hand components beyond the {most} of {figure:text} omitted",
    "F007.joints-matched": "{motion:text} drives {n} of {all} joints of {figure:text}",
    "F007.joints-matched-as-follows": "{motion:text} drives {n} of {all} joints of {figure:text}: "
    "{pairs:list60}",
    "F007.joints-at-rest": "joints kept at rest: {names:list60}",
    "F007.joints-without-partner": "unmatched joints of {motion:text}: {names:list60}",
    "F007.path-scaled": "root path scaled by {scale:.4g}, the ratio of {by}",
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
    "F007.body-joints-left-out": "{n:#joint} of the pose beyond the body's {own} omitted",
    "F007.part-left-out": "{part} omitted: {figure:text} has no such joint",
    "F007.hand-part-left-out": "{part} omitted: {figure:text} has no hand components",
}

PHRASES = {
    "joint-by-joint": "{joint:text} by {partner:text}",
    "ratio-of-legs": "leg lengths",
    "ratio-of-arms": "arm lengths",
    "ratio-of-bones": "bone lengths",
    "ratio-of-nothing": "unknown lengths",
    "left-moves": "joint translations",
    "left-place": "figure translation",
    "left-size": "figure scale",
    "left-shape": "figure shape",
    "scale-not-positive": "scale: expected a positive number, found {found:g}",
    "scale-out-of-range": "scale: expected {low:g} to {high:g}, found {found:g}",
    "translation-too-far": "translation: expected at most {most:g}, found {found:g}",
}
