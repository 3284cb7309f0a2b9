"""Short scripts for the Python API, which ``viewer help examples`` shows and the tests run."""

EXAMPLES = {
    "open_and_pose": "open a character, pose it, draw it, write the posed mesh",
    "own_arrays": "a figure from arrays: mesh, skeleton and weights, written as glTF",
    "joint_weights": "the weights of a joint, as numbers and as colours",
    "retarget_bvh": "a BVH motion onto a character with other joints",
    "capture_to_bvh": "captured people to BVH files",
    "lint_in_ci": "check rigs in continuous integration",
    "compare_rigs": "how far two rigs of one character differ, in many poses",
    "paper_figure": "a figure for a paper: white, orthographic, from the side",
    "batch": "a function for many files, in worker processes, with a table of results",
    "live_training": "a window that moves while a program computes",
    "own_scalar": "your own numbers per vertex as colours, with a legend",
}
"""Scripts in this folder, and what they show."""
