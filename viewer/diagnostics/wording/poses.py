"""Messages about pose files, what figures do not take of them, and landmark files."""

_JSON = "expected JSON, found "

MESSAGES = {
    "F002.pose-clipboard": "expected a pose, found nothing",
    "F002.no-pose": "--pose: expected a pose, found a figure or motion",
    # JSON
    "F002.json": _JSON + "a mistake: {reason:text}",
    "F002.json-nesting": _JSON + "too deep a nesting",
    "F002.json-twice": 'expected every key once, found "{found:text}" twice',
    "F002.json-constant": "expected a finite number, found {found}",
    # Pose files
    "F002.pose-empty": "expected the numbers of a pose, found {found:text}",
    "F002.pose-names": "{item:text}: expected {expected} names as in dofs, found {found}",
    "F002.pose-keys": "expected a pose (dofs, poses, body_pose, betas …), found keys "
    "{keys:list12}{near:+; {}}",
    "F002.pose-no-keys": "expected a pose (dofs, poses, body_pose, betas …), found no keys",
    "F002.pose-object": "expected a pose (an object with names), found {found}",
    "F002.pose-frames": "{item:text}: expected one pose, found {found} frames",
    "F002.pose-three": "{item:text}: expected 3 numbers, found {found}",
    "F002.pose-single": "{item:text}: expected one number, found {found}",
    "F002.pose-dofs": "dofs: expected names with numbers, found {found}",
    "F002.pose-dof": "dofs: {item:text}: expected a number, found {found}",
    "F002.pose-array": "{item:text}: expected {expected}, found {found}",
    "F003.pose-number": "{item:text}: expected finite numbers, found {found:g}",
    "F002.pose-list": "{item:text}: expected a list of names, found {found} dimensions",
    "F002.pose-quaternion": "{item:text}: {joint:text}: expected a quaternion, found four zeros",
    "F002.pose-word": "{item:text}: expected a word, found {found}",
    "F002.pose-up": 'up: expected "y" or "z", found {found:quoted}',
    "F007.pose-keys": "keys that mean nothing in a pose: {keys:list12}",
    # What a figure does not take
    "F002.pose-misfit": "{problem}",
    "F002.pose-unknown-dof": 'expected a DOF of {figure:text}, found "{found:text}": {reason}',
    "F002.pose-vector": "expected {expected} pose numbers for {figure:text}, found {found}",
    "F002.pose-body": "body_pose: expected 3 numbers a joint, of up to {most} joints, found "
    "{found:#number}",
    "F002.pose-part": "{item:text}: expected {expected} numbers, found {found}",
    # Landmarks
    "F002.landmark": 'expected six numbers, or a joint and three numbers, found "{found:text}"',
    "F002.landmark-joint": 'expected a joint of {figure:text}, found "{found:text}"; {near}',
    "F002.landmarks": "expected 3 or more pairs of points, found {found}",
}

PHRASES = {
    "pose-names": "names",
    "pose-numbers": "numbers",
    "pose-flag": "true or false",
    "pose-ragged": "lists of different lengths or depths",
    "pose-shape": "{shape:axes}",
    "pose-one-number": "one number",
    "pose-word": "{word}",
    "pose-key-near": "{name} ({near})",
}
