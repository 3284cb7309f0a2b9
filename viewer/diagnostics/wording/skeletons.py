"""Messages about skeletons and their limits."""

MESSAGES = {
    "S004.clamped": "{n:#DOF}, {dof}: clamped",
    "S004.pose": "{n:#DOF} of the pose {n:?is outside its|are outside their} limits: {dof}",
    "S005.dofs": "{n:#DOF/{all}|is|are} locked: {names:list}",
    "S006.joints": "{n:#joint} share their names with others: {names:list}",
    "S007.joints": "{n:#joint|has|have} no name, first joint {joint}",
    "S008.roots": "{n} joints have no parent: {names:list}",
    "S009.rotations": "{n:#rest rotation|is|are} not of length 1, {joint:text} has {length:.4g}",
    "S010.scales": "{n:#rest scale|is|are} 0 or less, {joint:text} has {x:zg} {y:zg} {z:zg}",
}

PHRASES = {
    "repeated-name": "{name:quoted} ({n})",
    "beyond-limits": "{dof:text} is {value}{when}, its limits are {low} and {high}",
    "below-minimum": "{dof:text} is {value}{when}, its minimum is {low}",
    "above-maximum": "{dof:text} is {value}{when}, its maximum is {high}",
    "in-frame": " in frame {frame} at {time:z.3f} s",
}
