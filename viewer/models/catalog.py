"""Catalogue of the body models that the viewer reads: publisher, licence and source."""

from __future__ import annotations

from viewer.data_classes import dataclass

_RESEARCH = "research only"


@dataclass(frozen=True, slots=True)
class Publication:
    """Publication of a kind of body model."""

    title: str
    """Name of the model."""
    about: str
    """Description of its content, in a few words."""
    licence: str
    """Short name of the licence."""
    address: str
    """Web address, or the command that adds it."""


CATALOG = {
    "body": Publication("bundled body", "an adult in SMPL's layout", "CC0", "viewer --body"),
    "anny": Publication("Anny", "all ages, faces, four rigs", "CC0", "viewer models add anny"),
    "mhr": Publication(
        "MHR", "body of SAM 3D Body", "Apache-2.0", "https://github.com/facebookresearch/MHR"
    ),
    "smpl": Publication("SMPL", "body", _RESEARCH, "https://smpl.is.tue.mpg.de"),
    "smplh": Publication("SMPL+H", "body and hands", _RESEARCH, "https://mano.is.tue.mpg.de"),
    "smplx": Publication(
        "SMPL-X", "body, hands and face", _RESEARCH, "https://smpl-x.is.tue.mpg.de"
    ),
    "mano": Publication("MANO", "a hand", _RESEARCH, "https://mano.is.tue.mpg.de"),
    "flame": Publication("FLAME", "a head", "CC-BY 4.0 (2023 Open)", "https://flame.is.tue.mpg.de"),
    "star": Publication("STAR", "body", _RESEARCH, "https://star.is.tue.mpg.de"),
    "supr": Publication(
        "SUPR", "body, hands, feet and face", _RESEARCH, "https://supr.is.tue.mpg.de"
    ),
    "skel": Publication("SKEL", "body with bones", _RESEARCH, "https://skel.is.tue.mpg.de"),
    "smil": Publication("SMIL", "an infant", _RESEARCH, "https://s.fhg.de/smil"),
    "smal": Publication("SMAL", "four-legged animals", _RESEARCH, "https://smal.is.tue.mpg.de"),
    "pig": Publication("PIG", "a pig", "MIT", "https://github.com/anl13/PIG_model"),
}
"""Publications by the kind of model, the part of its name before the colon."""
