"""Generator of ``smplx_expected.npz``, the results of the package smplx for the synthetic models.
Run it in a separate environment from any folder::

    pip install numpy scipy torch smplx==0.1.28
    python tests/data/make_smplx_expected.py

The file in the repository was made with Python 3.11, smplx 0.1.28, torch 2.15.0 (CPU) and
numpy 2.4.6. Nothing of the viewer is used. Each case is also worked out in plain numpy from the
published formulas, and the script stops where the two differ by more than 1e-7 m.

In the file, ``cases`` holds the names, and for each name there are ``name/vertices`` (V,3) and
``name/joints`` (J,3, landmarks left out), in float64, and what was given to smplx:

* ``name/kind``, and ``n_vertices``, ``n_shapes`` and ``n_expressions`` to build the model with
  (``synthetic_smpl.model``);
* ``betas``, ``expression``, ``transl``, ``global_orient``, ``body_pose``, ``jaw_pose``,
  ``leye_pose``, ``reye_pose``, ``neck_pose`` (flame), ``left_hand_pose`` and ``right_hand_pose``,
  ``hand_pose`` (mano): vectors; one that is absent is zero;
* kinds with fingers: ``use_pca`` and ``flat_hand_mean``. With ``use_pca`` the hand vectors are
  coefficients, as many as the vector is long, else 45 angles. The mean is added to either, also
  to an absent vector, unless ``flat_hand_mean``.
"""

import contextlib
import io
import pickle
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
TARGET = HERE / "smplx_expected.npz"
TOLERANCE = 1e-7

Inputs = dict[str, Any]

# The length of each pose vector (hands without PCA) in the order of the joints.
POSE_PARTS = {
    "smpl": {"global_orient": 3, "body_pose": 69},
    "smplh": {"global_orient": 3, "body_pose": 63, "left_hand_pose": 45, "right_hand_pose": 45},
    "smplx": {
        "global_orient": 3,
        "body_pose": 63,
        "jaw_pose": 3,
        "leye_pose": 3,
        "reye_pose": 3,
        "left_hand_pose": 45,
        "right_hand_pose": 45,
    },
    "mano": {"global_orient": 3, "hand_pose": 45},
    "flame": {"global_orient": 3, "neck_pose": 3, "jaw_pose": 3, "leye_pose": 3, "reye_pose": 3},
}
HANDS = {
    "left_hand_pose": ("hands_componentsl", "hands_meanl"),
    "right_hand_pose": ("hands_componentsr", "hands_meanr"),
    "hand_pose": ("hands_components", "hands_mean"),
}
VERTICES = {"mano": 40, "flame": 32}  # elsewhere 60
SETTINGS = ("kind", "n_vertices", "n_shapes", "n_expressions", "use_pca", "flat_hand_mean")


def wave(seed: float, count: int, size: float) -> np.ndarray:
    """Return numbers within ``size`` that look random."""
    index = np.arange(1, count + 1)
    return size * np.sin(seed + 2.3 * index + 0.19 * index * index)


def turns(seed: float, count: int, size: float = 0.5) -> np.ndarray:
    """Return a pose vector in which the fourth to seventh joints rotate by 0, pi, 1e-9 and 4.2."""
    pose = wave(seed, count, size).reshape(-1, 3)
    if len(pose) > 6:
        pose[3] = 0.0
        pose[4] = np.array([2.0, -3.0, 6.0]) * (np.pi / 7.0)
        pose[5] = np.array([6.0, 2.0, -3.0]) * (1e-9 / 7.0)
        pose[6] = np.array([-3.0, 6.0, 2.0]) * (4.2 / 7.0)
    return pose.ravel()


def all_cases() -> dict[str, Inputs]:
    """Return the inputs of every case, including the settings."""
    transl = np.array([0.75, -1.5, 2.25])
    root = np.array([0.4, -1.9, 0.7])
    shape = wave(0.1, 10, 2.0)
    expression = wave(0.2, 10, 2.0)
    face = {
        "jaw_pose": np.array([0.3, -0.05, 0.02]),
        "leye_pose": np.array([-0.1, 0.35, 0.03]),
        "reye_pose": np.array([0.05, -0.25, -0.02]),
    }
    cases: dict[str, Inputs] = {}

    def add(kind: str, name: str, **inputs: Any) -> None:
        settings: Inputs = {"kind": kind, "n_vertices": VERTICES.get(kind, 60), "n_shapes": 10}
        settings["n_expressions"] = 10
        if any(part in HANDS for part in POSE_PARTS[kind]):
            settings |= {"use_pca": False, "flat_hand_mean": True}
        cases[f"{kind}_{name}"] = settings | inputs

    for kind in POSE_PARTS:
        add(kind, "rest")
        add(kind, "shape", betas=shape)
        add(kind, "transl", transl=transl)
        add(kind, "root", betas=shape, global_orient=root, transl=transl)
    for kind in ("smpl", "smplx", "flame"):
        add(kind, "few_betas", betas=shape[:4])
        add(kind, "root_pi", global_orient=np.array([0.0, np.pi, 0.0]))
    for kind in ("smpl", "smplh", "smplx"):
        body = POSE_PARTS[kind]["body_pose"]
        add(kind, "pose", body_pose=turns(0.3, body))
        add(kind, "pose_shape", body_pose=turns(0.4, body), betas=shape)

    for kind in ("smplh", "smplx", "mano"):
        sides = [part for part in POSE_PARTS[kind] if part in HANDS]
        posed = {"use_pca": True}
        for count in (6, 12, 45):
            if kind == "mano" and count == 45:
                continue  # smplx interprets 45 coefficients of MANO as angles
            hands = {side: wave(0.5 + n, count, 1.2) for n, side in enumerate(sides)}
            add(kind, f"pca{count}_mean", **posed, **hands, flat_hand_mean=False)
            if count < 45:
                add(kind, f"pca{count}_flat", **posed, **hands)
        hands = {side: turns(0.6 + n, 45) for n, side in enumerate(sides)}
        add(kind, "angles_flat", **hands)
        add(kind, "angles_mean", **hands, flat_hand_mean=False)
        add(kind, "rest_mean", flat_hand_mean=False)

    everything: Inputs = {"betas": shape, "global_orient": root, "transl": transl}
    add("smpl", "all", **everything, body_pose=turns(0.7, 69, 0.8))
    pca_hands = {
        "use_pca": True,
        "flat_hand_mean": False,
        "left_hand_pose": wave(0.8, 12, 1.5),
        "right_hand_pose": wave(0.9, 12, 1.5),
    }
    moved = everything | pca_hands | {"body_pose": turns(0.7, 63, 0.8)}
    add("smplh", "all", **moved)
    add("smplx", "expression", expression=expression)
    add("smplx", "face", **face)
    add("smplx", "all", **moved, **face, expression=expression)
    long_file = {"n_shapes": 300, "n_expressions": 100}
    betas, expressions = wave(1.1, 20, 1.5), wave(1.2, 50, 1.5)
    add("smplx", "columns400", **long_file, betas=betas, expression=expressions)
    long_moved = moved | face | long_file | {"betas": betas, "expression": expressions[:10]}
    add("smplx", "columns400_all", **long_moved)
    add("mano", "all", **everything, hand_pose=turns(0.7, 45, 0.8), flat_hand_mean=False)
    neck = {"neck_pose": np.array([0.2, 0.5, -0.1])}
    add("flame", "expression", expression=expression)
    add("flame", "face", **face, **neck)
    add("flame", "edges", jaw_pose=turns(0.3, 21)[12:15], leye_pose=turns(0.3, 21)[15:18])
    add("flame", "all", **everything, **face, **neck, expression=expression)
    add("flame", "columns400", **long_file, betas=betas, expression=expressions)
    return cases


def smplx_result(
    model: Mapping[str, np.ndarray], inputs: Inputs, folder: Path
) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices and joints that the package smplx computes."""
    import smplx
    import torch
    from smplx.utils import Struct

    kind = inputs["kind"]
    options: Inputs = {
        "dtype": torch.float64,
        "num_betas": len(inputs.get("betas", np.zeros(10))),
        "num_expression_coeffs": len(inputs.get("expression", np.zeros(10))),
        "use_face_contour": False,
    }
    hand = next((part for part in POSE_PARTS[kind] if part in HANDS), None)
    if hand is not None:
        options |= {name: bool(inputs[name]) for name in ("use_pca", "flat_hand_mean")}
        options["num_pca_comps"] = len(inputs.get(hand, np.zeros(6))) if inputs["use_pca"] else 6
    if kind == "smplx":  # these two models can only be read from files
        np.savez(folder / "SMPLX_NEUTRAL.npz", **model)
        body = smplx.SMPLX(str(folder / "SMPLX_NEUTRAL.npz"), ext="npz", **options)
    elif kind == "flame":
        landmarks = {"lmk_face_idx": np.arange(51), "lmk_b_coords": np.full((51, 3), 1.0 / 3.0)}
        (folder / "FLAME_NEUTRAL.pkl").write_bytes(pickle.dumps(dict(model)))
        (folder / "flame_static_embedding.pkl").write_bytes(pickle.dumps(landmarks))
        body = smplx.FLAME(str(folder), **options)
    else:
        makers = {"smpl": smplx.SMPL, "smplh": smplx.SMPLH, "mano": smplx.MANO}
        body = makers[kind]("", data_struct=Struct(**model), **options)
    # Some vertices of the published meshes are extra joints; these small models have none.
    body.vertex_joint_selector.extra_joints_idxs = torch.zeros(0, dtype=torch.long)
    vectors = {
        name: torch.tensor(np.array(value), dtype=torch.float64)[None]
        for name, value in inputs.items()
        if name not in SETTINGS
    }
    with torch.no_grad():
        output = body(**vectors)
    n_joints = len(model["J_regressor"])
    return output.vertices[0].numpy().copy(), output.joints[0, :n_joints].numpy().copy()


def rotation(vector: np.ndarray) -> np.ndarray:
    """Return the matrix of an axis-angle vector (Rodrigues), exact near zero."""
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    square = float(vector @ vector)
    if square < 1e-8:
        first = 1.0 - square / 6.0 + square * square / 120.0
        second = 0.5 - square / 24.0 + square * square / 720.0
    else:
        angle = np.sqrt(square)
        first = np.sin(angle) / angle
        second = 2.0 * np.sin(angle / 2.0) ** 2 / square
    return np.eye(3) + first * cross + second * cross @ cross


def plain_pose(model: Mapping[str, np.ndarray], inputs: Inputs) -> np.ndarray:
    """Return the axis-angle vectors of all joints, (J, 3)."""
    vectors = []
    for part, count in POSE_PARTS[inputs["kind"]].items():
        vector = inputs.get(part)
        if part in HANDS:
            components, mean = (model[key] for key in HANDS[part])
            if vector is not None and inputs["use_pca"]:
                vector = sum(number * components[row] for row, number in enumerate(vector))
            if not inputs["flat_hand_mean"]:
                vector = mean if vector is None else vector + mean
        vectors.append(np.zeros(count) if vector is None else vector)
    return np.concatenate(vectors).reshape(-1, 3)


def plain_result(
    model: Mapping[str, np.ndarray], inputs: Inputs
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices and joints from the formulas, one vertex at a time, and the rest joints."""
    directions = model["shapedirs"]
    first_expression = 300 if directions.shape[2] >= 400 else 10
    rest = model["v_template"].copy()
    for column, number in enumerate(inputs.get("betas", ())):
        rest += number * directions[:, :, column]
    for column, number in enumerate(inputs.get("expression", ()), start=first_expression):
        rest += number * directions[:, :, column]
    rest_joints = model["J_regressor"] @ rest

    rotations = [rotation(vector) for vector in plain_pose(model, inputs)]
    features = [entry for turn in rotations[1:] for row in turn - np.eye(3) for entry in row]
    bent = rest.copy()
    for column, number in enumerate(features):
        bent += number * model["posedirs"][:, :, column]

    parents = model["kintree_table"][0]
    turned: list[np.ndarray] = []
    joints: list[np.ndarray] = []
    for joint, turn in enumerate(rotations):
        if joint == 0:
            turned.append(turn)
            joints.append(rest_joints[0])
            continue
        parent = int(parents[joint])
        turned.append(turned[parent] @ turn)
        bone = rest_joints[joint] - rest_joints[parent]
        joints.append(turned[parent] @ bone + joints[parent])

    vertices = np.zeros_like(bent)
    for vertex, point in enumerate(bent):
        for joint in np.flatnonzero(model["weights"][vertex]):
            place = turned[joint] @ (point - rest_joints[joint]) + joints[joint]
            vertices[vertex] += model["weights"][vertex, joint] * place
    transl = inputs.get("transl", np.zeros(3))
    return vertices + transl, np.array(joints) + transl, rest_joints


def main() -> None:
    """Compute every case both ways, and write the file."""
    sys.path.insert(0, str(HERE.parent / "formats"))
    from synthetic_smpl import model

    cases = all_cases()
    arrays: dict[str, np.ndarray] = {"cases": np.array(list(cases))}
    worst = 0.0
    for name, inputs in cases.items():
        made = model(*(inputs[key] for key in SETTINGS[:4]))
        with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
            vertices, joints = smplx_result(made, inputs, Path(folder))
        plain_vertices, plain_joints, rest_joints = plain_result(made, inputs)
        gap = max(np.abs(vertices - plain_vertices).max(), np.abs(joints - plain_joints).max())
        moved = np.abs(joints - rest_joints).max()
        print(f"{name:24} differs {gap:.1e} m; farthest joint moved {moved:.3f} m")
        if not gap < TOLERANCE:
            raise SystemExit(f"{name}: smplx and the formulas differ by {gap}")
        worst = max(worst, gap)
        for key, value in (inputs | {"vertices": vertices, "joints": joints}).items():
            arrays[f"{name}/{key}"] = np.asarray(value)
    np.savez_compressed(TARGET, **arrays)
    print(f"{len(cases)} cases, at most {worst:.1e} m apart, {TARGET.stat().st_size} bytes")


if __name__ == "__main__":
    main()
