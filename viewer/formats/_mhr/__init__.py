"""Parts of MHR's portable files: the rig, and meshes at several levels of detail."""
