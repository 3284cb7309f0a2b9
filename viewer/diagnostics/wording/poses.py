"""Messages about pose files, applying them to a figure, and landmark files."""

_JSON = "expected JSON, found "

MESSAGES = {
    "F002.pose-clipboard": "expected a pose, found no text",
    "F002.no-pose": "--pose: expected a pose, found a figure or motion",
    # JSON
    "F002.json": _JSON + "a syntax error: {reason:text}",
    "F002.json-nesting": "JSON nested too deeply",
    "F002.json-twice": 'expected unique keys, found "{found:text}" twice',
    "F002.json-constant": "expected a finite number, found {found}",
    # Pose files
    "F002.pose-empty": "expected pose values, found {found:text}",
    "F002.pose-names": "{item:text}: expected {expected} names to match dofs, found {found}",
    "F002.pose-keys": "expected a pose (dofs, poses, body_pose, betas …), found keys "
    "{keys:list12}{near:+; {}}",
    "F002.pose-no-keys": "expected a pose (dofs, poses, body_pose, betas …), found no keys",
    "F002.pose-object": "expected a pose (an object with named values), found {found}",
    "F002.pose-frames": "{item:text}: expected a single pose, found {found} frames",
    "F002.pose-three": "{item:text}: expected 3 numbers, found {found}",
    "F002.pose-single": "{item:text}: expected a single number, found {found}",
    "F002.pose-dofs": "dofs: expected an object mapping names to numbers, found {found}",
    "F002.pose-dof": "dofs: {item:text}: expected a number, found {found}",
    "F002.pose-array": "{item:text}: expected {expected}, found {found}",
    "F003.pose-number": "{item:text}: expected finite numbers, found {found:g}",
    "F002.pose-list": "{item:text}: expected a one-dimensional list of names, found {found} "
    "dimensions",
    "F002.pose-quaternion": "{item:text}: {joint:text}: expected a quaternion, found four zeros",
    "F002.pose-word": "{item:text}: expected a string, found {found}",
    "F002.pose-up": 'up: expected "y" or "z", found {found:quoted}',
    "F007.pose-keys": "ignored unknown keys: {keys:list12}",
    # Poses that do not match a figure
    "F002.pose-misfit": "{problem}",
    "F002.pose-unknown-dof": 'expected a DOF of {figure:text}, found "{found:text}": {reason}',
    "F002.pose-vector": "expected {expected} pose values for {figure:text}, found {found}",
    "F002.pose-body": "body_pose: expected 3 numbers per joint for at most {most} joints, found "
    "{found:#number}",
    "F002.pose-part": "{item:text}: expected {expected} numbers, found {found}",
    # Landmarks
    "F002.landmark": 'expected six numbers, or a joint and three numbers, found "{found:text}"',
    "F002.landmark-joint": 'expected a joint of {figure:text}, found "{found:text}"; {near}',
    "F002.landmarks": "expected at least 3 pairs of points, found {found}",
    "F002.landmark-extents": "expected points that differ in scale by less than 1e9, found extents "
    "of {own:.3g} in the template and {other:.3g} in the target",
}

PHRASES = {
    "pose-names": "names",
    "pose-numbers": "numbers",
    "pose-flag": "true or false",
    "pose-ragged": "ragged lists",
    "pose-shape": "{shape:axes}",
    "pose-one-number": "a single number",
    "pose-word": "{word}",
    "pose-key-near": "{name} ({near})",
}
