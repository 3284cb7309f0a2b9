"""Transfer of a template's joints, pose, motions and correctives to a target mesh."""
