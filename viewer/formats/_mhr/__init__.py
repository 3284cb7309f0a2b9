"""The parts of MHR's portable files: the rig, and meshes in several levels of detail."""
