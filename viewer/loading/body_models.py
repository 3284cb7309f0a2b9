"""Choice of the figure that shows a captured body: by name, among the files, or in the folder."""

from __future__ import annotations

from dataclasses import field, replace
from pathlib import Path
from typing import Literal

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.errors import FormatError
from viewer.formats import Source, read
from viewer.loading.contents import read_files
from viewer.loading.pairing import joined_figures
from viewer.loading.scene_draft import SceneDraft
from viewer.loading.settings import MotionSettings
from viewer.models import bundled_body, family_model, models_of_kind, named_files
from viewer.phrases import Remedy, listed
from viewer.rigs.bodies.smpl_family import ShapeSpace
from viewer.rigs.figure import Figure

_ROOTS = ("pelvis", "wrist", "global")  # root joint names of the SMPL family
_HIP = "left_hip"


def is_body(figure: Figure) -> bool:
    """Return whether a figure can show captured bodies: it has the family's root and shapes."""
    # A character with the same joint names cannot, whether it is a VRM file or was rigged from the
    # bundled body: its size, rest pose and origin differ. The root of Unreal's characters and of
    # animals has the family's name, too, but their legs do not.
    skeleton = figure.skeleton
    if skeleton is None or figure.mesh is None or skeleton.humanoid is not None:
        return False
    if figure.blend_shapes is None or "shape" not in figure.blend_shapes.groups:
        return False
    root = skeleton.names[0]
    return root in _ROOTS and (root != _ROOTS[0] or _HIP in skeleton.names)


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """The figure for a body, and where it comes from."""

    figure: Figure
    origin: Literal["named", "file", "folder", "bundled"]
    target: Figure | None = None
    """The figure of ``--model`` if it has different joints: the body moves it."""
    notes: tuple[Diagnostic, ...] = ()

    @property
    def is_bundled(self) -> bool:
        """Whether it is the bundled body, to which shape coefficients of files do not apply."""
        # Only the bundled body has shapes named after their effects.
        shapes = self.figure.blend_shapes
        return shapes is not None and "stature" in shapes.names

    @property
    def drives(self) -> bool:
        """Whether the body moves an open character instead: nobody has asked to see it."""
        return self.origin in ("folder", "bundled") or (self.origin == "file" and self.is_bundled)


@dataclass(slots=True, eq=False)
class BodyModels:
    """Chooses figures for bodies, each of which is read once."""

    # A body is shown by the model of ``--model``, else by a body model among the files, which is
    # then not a separate actor, else by the model of the model folder that has the joints and
    # gender of the body, else by the bundled body.

    draft: SceneDraft
    settings: MotionSettings
    _read: dict[tuple[Path, ...], Figure] = field(default_factory=dict)
    _taken: list[Figure] = field(default_factory=list)

    def wanted(self, space: ShapeSpace) -> ShapeSpace:
        """Return a shape space with the gender that the user asked for."""
        if space.model:
            self.draft.used_options.add("gender")
        return replace(space, gender=self.settings.gender or space.gender)

    def choose(self, path: Path, space: ShapeSpace) -> Choice:
        """Return the figure for a body."""
        space, has_parameters = self.wanted(space), space.model == "MHR"
        named = self.named(space.gender)
        if named is not None:
            if is_body(named) or (named.parameters is not None and has_parameters):
                return Choice(named, "named")
            # Bodies given by parameters drive another figure via the model of the parameters.
            carrier: Figure | None = None
            notes: tuple[Diagnostic, ...] = ()
            if has_parameters:
                carrier, notes = self._of_folder(path, space, "carrier")
            if carrier is not None:
                return Choice(carrier, "folder", named, notes)
            return Choice(self._bundled(), "bundled", named, notes)
        among = self._among_files(space)
        if among is not None:
            return Choice(among, "file")
        found, notes = self._of_folder(path, space, "model")
        if found is not None:
            return Choice(found, "folder", notes=notes)
        return Choice(self._bundled(), "bundled", notes=notes)

    def named(self, gender: str) -> Figure | None:
        """Return the figure given by ``--model``, if any; its kind alone leaves the gender open."""
        settings = self.settings
        if settings.model is None:
            return None
        paths = named_files(settings.model, settings.gender or gender)
        if paths not in self._read:
            self._read[paths] = self._figure_of(paths)
        return self._read[paths]

    def _figure_of(self, paths: tuple[Path, ...]) -> Figure:
        options = MotionSettings(rig=self.settings.rig, lod=self.settings.lod)
        contents = read_files(paths, settings=options)
        joined = [figure for _, figure in joined_figures(contents.figures)]
        figure = next((each for each in joined if each.is_attached), next(iter(joined), None))
        if figure is None or figure.skeleton is None or figure.mesh is None:
            raise FormatError.fault("F002.no-body-model: --model: not a body model", paths[0])
        self.draft.diagnostics += contents.diagnostics
        self.draft.used_options |= {"model", *(contents.used_options or ())}
        self.draft.files += contents.files
        return figure

    def _among_files(self, space: ShapeSpace) -> Figure | None:
        """Return the body model among the files that suits a body best; it is no actor any more."""
        actors = self.draft.actors
        free = [actor for actor in actors if actor.clip is None and is_body(actor.figure)]
        figures = [*self._taken, *(actor.figure for actor in free)]
        if not figures:
            return None

        def misfit(figure: Figure) -> tuple[bool, bool]:
            own = figure.shape_space
            return not own.shares_coefficients(space), own.gender != space.gender

        best = min(figures, key=misfit)
        index = next((row for row, actor in enumerate(actors) if actor.figure is best), None)
        if best not in self._taken and index is not None:
            self._taken.append(self.draft.take(index).figure)
        return best

    def _of_folder(
        self, path: Path, space: ShapeSpace, use: str
    ) -> tuple[Figure | None, tuple[Diagnostic, ...]]:
        """Return the model folder's model, if readable, and messages."""
        # The use is "model" if it is shown, "carrier" if it moves the figure of ``--model``.

        def note(message: str, **values: object) -> tuple[Diagnostic, ...]:
            return (Diagnostic(message, path, values=values),)

        found = family_model(space.model, space.gender)
        if found is None:
            others = models_of_kind(space.model)
            wanted = space.title
            if not others:
                return None, ()
            return None, note(
                "F007.own-model-missing: the model folder has no {wanted} model, only {names}: "
                "{remedy}",
                wanted=wanted,
                names=listed(others),
                remedy=Remedy("open one of them first", "--gender chooses one"),
            )
        if (found,) not in self._read:
            try:
                model = read(Source.open(found))
            except FormatError as problem:  # the user has not named this file
                return None, note(
                    "F007.own-model-unreadable: the model in the model folder cannot be read: "
                    "{problem}",
                    problem=problem.diagnostic,
                )
            if not isinstance(model, Figure) or not (is_body(model) or space.model == "MHR"):
                return None, ()
            self._read[(found,)] = model
            self.draft.files.append(found)
        figure = self._read[(found,)]
        gender = figure.shape_space.gender
        if space.gender and gender and gender != space.gender:
            return figure, note(
                "F007.own-model-of-other-gender: {model} is used: the model folder has no {wanted} "
                "model",
                model=found.name,
                wanted=space.title,
            )
        if use == "carrier":
            message = "F007.own-carrier: motion computed with {model} from the model folder"
        else:
            message = "F007.own-model: {model} from the model folder is used ({remedy})"
        remedy = Remedy("open another one first to use it", "--model selects another")
        return figure, note(message, model=found.name, remedy=remedy)

    def _bundled(self) -> Figure:
        paths = (bundled_body(),)
        if paths not in self._read:
            body = read(Source.open(paths[0]))
            assert isinstance(body, Figure)  # the bundled body is a figure
            self._read[paths] = body
        return self._read[paths]
