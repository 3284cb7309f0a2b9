"""Messages about skeletons and their limits."""

from viewer.diagnostics.codes import Code

CODES = {
    "S001": Code("error", "parent after its child", "list parents before their children"),
    "S002": Code("error", "cyclic hierarchy", "give one of these joints another parent"),
    "S003": Code("error", "limit with minimum above maximum", "swap the two values"),
    "S004": Code("warning", "pose outside its limits", "widen the limit or change the pose"),
    "S005": Code("note", "locked DOFs", "none if these joints should not move"),
    "S006": Code(
        "warning", "duplicate joint names", "rename them: many programs match joints by name"
    ),
    "S007": Code("warning", "unnamed joints", "name them: many programs match joints by name"),
    "S008": Code(
        "note", "multiple roots", "give them a common parent for programs that expect a single root"
    ),
    "S009": Code("warning", "non-unit rest rotation", "normalise the quaternion"),
    "S010": Code("warning", "non-positive rest scale", "freeze the scale of this joint"),
}

MESSAGES = {
    "S004.clamped": "{n:#DOF} clamped: {dof}",
    "S004.pose": "{n:#DOF} of the pose {n:?is outside its|are outside their} limits: {dof}",
    "S005.dofs": "{n:#DOF/{all}|is|are} locked: {names:list}",
    "S006.joints": "{n:#joint} with duplicate names: {names:list}",
    "S007.joints": "{n:#joint|has|have} no name (first: joint {joint})",
    "S008.roots": "{n} joints have no parent: {names:list}",
    "S009.rotations": "{n:#rest rotation|is|are} not normalised (first: length {length:.4g} at "
    "{joint:text})",
    "S010.scales": "{n:#rest scale|is|are} not positive (first: {x:zg} {y:zg} {z:zg} at "
    "{joint:text})",
}

PHRASES = {
    "repeated-name": "{name:quoted} ({n})",
    "beyond-limits": "{dof:text} is {value}{when}; its limits are {low} and {high}",
    "below-minimum": "{dof:text} is {value}{when}; its minimum is {low}",
    "above-maximum": "{dof:text} is {value}{when}; its maximum is {high}",
    "in-frame": " in frame {frame} at {time:z.3f} s",
}
