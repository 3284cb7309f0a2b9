"""Settings of a rig transfer."""

from __future__ import annotations

from dataclasses import field
from typing import Literal, TypeAlias

from viewer.autorig.alignment.surface_alignment import AlignmentSettings
from viewer.autorig.weights.weight_transfer import WeightSettings
from viewer.data_classes import dataclass, setting
from viewer.errors import RigError

TransferMethod: TypeAlias = Literal["robust", "nearest", "heat", "voxel"]
METHODS: dict[TransferMethod, str] = {
    "robust": "closest surface points if they agree, other weights inpainted (Abdrashitov et al. "
    "2023)",
    "nearest": "aligned boxes, nearest vertices, joints copied (Tex-An Mesh)",
    "heat": "weights from the bones that the surface sees (Baran and Popović 2007)",
    "voxel": "weights from paths through the inside, for many separate parts (Dionne and de Lasa "
    "2013)",
}
"""Methods offered by menus and the command line."""

BINDING: tuple[TransferMethod, ...] = ("heat", "voxel")
"""Methods that use only the template's skeleton, where it is."""

JointPlaces: TypeAlias = Literal["surface", "alignment"]
JOINTS: tuple[JointPlaces, ...] = ("surface", "alignment")
"""Placement of joints: by the surface around them, or only by the alignment."""


SYMMETRIES: dict[str, str] = {
    "auto": "automatic",
    "x": "across x",
    "y": "across y",
    "z": "across z",
    "none": "none",
}
"""Planes of symmetry of a skeleton that is found in a mesh, with their labels."""


@dataclass(frozen=True, slots=True)
class SkeletonSettings:
    """Options of the skeleton that is found in a mesh."""

    symmetry: str = setting(
        "auto",
        "with --auto, the axis along which limbs mirror each other, or none; auto: if a vertical "
        "plane of symmetry is found (default: {default})",
        choices=SYMMETRIES,
    )
    joint_spacing: float = setting(
        1.0,
        "with --auto, distance of the joints in limbs without sharp bends, relative to the usual "
        "distance (default: {default})",
        metavar="X",
        limits=(0.1, 10.0),
    )

    def __post_init__(self) -> None:
        if self.symmetry not in SYMMETRIES:
            raise RigError(f'symmetry: expected {", ".join(SYMMETRIES)}, found "{self.symmetry}"')
        if not 0.1 <= self.joint_spacing <= 10.0:
            raise RigError(f"joint_spacing: expected 0.1 to 10, found {self.joint_spacing:g}")


@dataclass(frozen=True, slots=True, eq=False)
class TransferSettings:
    """Options of a rig transfer."""

    method: TransferMethod = setting(
        "robust",
        "; ".join(f"{name}: {text}" for name, text in METHODS.items()) + "{usual}",
        choices=METHODS,
    )
    """All options but those of ``alignment`` and ``weights`` are for ``"robust"``."""
    alignment: AlignmentSettings = field(default_factory=AlignmentSettings)
    """Known facts about the alignment."""
    weights: WeightSettings = field(default_factory=WeightSettings)
    """Criteria for matching vertices, smoothing, and number of influences."""
    joints: JointPlaces = setting(
        "surface",
        "place joints by the surface around them, or only by the alignment (default: {default})",
        choices=JOINTS,
    )
    fits: bool = setting(
        True,
        "keep the template's pose and proportions, even if rotating its joints and scaling its "
        "limbs would align it with the mesh much better",
        flag="--no-fit",
    )
    """Whether the template's joints are rotated and its limbs scaled, if its pose or its
    proportions differ from the target's."""
    correctives: bool = setting(True, "omit the template's pose correctives")
    """Whether pose correctives of the template are transferred."""
    insists: bool = setting(
        False, "keep the rig even if it is probably wrong", flag="--keep-doubtful"
    )
    """Whether a rig that is probably wrong is returned, with warnings, rather than refused."""
    repairs: bool = True
    """Whether the neighbourhoods of singular vertices are smoothed."""

    def __post_init__(self) -> None:
        for name, known in (("method", tuple(METHODS)), ("joints", JOINTS)):
            if getattr(self, name) not in known:
                raise RigError(
                    f'{name}: expected {" or ".join(known)}, found "{getattr(self, name)}"'
                )
