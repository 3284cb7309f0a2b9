"""Animations of opened figures, of which the first or the requested one plays."""

from dataclasses import replace
from pathlib import Path

import pytest
from rig.animated import animated_leg, animation, bow, leg

from viewer.commands._info_clips import animation_lines, describe_animations
from viewer.diagnostics import Diagnostic
from viewer.errors import FormatError, RigError
from viewer.loading import Contents, MotionSettings, begin
from viewer.rig.figure import Figure, FigureGroup, read_from
from viewer.rig.motion.transform_clip import Animation


def opened(*figures, animation="", files=None):
    paths = files or [Path("hero.glb")] * len(figures)
    read = [read_from(path, figure) for path, figure in zip(paths, figures, strict=True)]
    contents = Contents(figures=list(zip(paths, read, strict=True)))
    return begin(contents, MotionSettings(animation=animation))[0]


def test_first_animation_plays_from_its_start():
    actor = opened(animated_leg()).actors[0]
    assert actor.clip is actor.figure.animations[0].clip() and actor.animation == 0
    assert actor.pose.shape_weights[1] == 0.5  # the value of the first weight key
    assert actor.clip.start == 0.5  # clips keep their times


def test_requested_animation_plays_in_every_figure_of_the_file():
    hero, hat = animated_leg(), replace(leg(name="hat"), animations=(animation(bow()),))
    scene = opened(hero, hat, animation="BOW")
    assert [actor.animation for actor in scene.actors] == [1, 0]
    scene = opened(hero, hat)
    assert [actor.animation for actor in scene.actors] == [0, -1]
    assert scene.actors[1].clip is None
    scene = opened(hero, hat, files=[Path("hero.glb"), Path("hat.glb")])
    assert [actor.animation for actor in scene.actors] == [0, 0]
    assert [actor.clip for actor in opened(hero, hat, animation="none").actors] == [None, None]


def test_characters_without_common_animations_play_their_first_ones():
    hero = animated_leg()
    horse = replace(leg(name="horse"), animations=(animation(replace(bow(), name="trot")),))
    scene = opened(hero, horse)
    assert [actor.animation for actor in scene.actors] == [0, 0]
    assert [actor.clip.name for actor in scene.actors] == ["wave", "trot"]
    # On request, only characters with that animation move.
    assert [actor.animation for actor in opened(hero, horse, animation="trot").actors] == [-1, 0]


def test_skeleton_without_a_mesh_moves_only_figures_of_other_files():
    rig = Figure("rig", skeleton=leg().skeleton, unit="m", animations=(animation(bow()),))
    contents = Contents(figures=[(Path("a.glb"), rig), (Path("a.glb"), leg())])
    contents.groups = [FigureGroup("a", (rig, contents.figures[1][1]))]
    assert [actor.figure.name for actor in begin(contents)[0].actors] == ["rig", "leg"]
    contents.groups = [FigureGroup(name, (figure,)) for name, (_, figure) in
                       zip("ab", contents.figures, strict=True)]  # fmt: skip
    (moved,) = begin(contents)[0].actors
    assert moved.figure.name == "leg" and moved.clip is not None


@pytest.mark.parametrize(
    ("figure", "key"), [(animated_leg(), "F004.animation"), (leg(), "F004.no-animations")]
)
def test_missing_animation_is_refused(figure, key):
    with pytest.raises(RigError) as refused:
        opened(figure, animation="jump")
    assert refused.value.diagnostic.key == key


def test_invalid_keys_are_an_error_only_if_their_animation_is_requested(tmp_path):
    def refuse():
        raise FormatError(Diagnostic("F002.misfit: {message}", tmp_path, values={"message": "bad"}))

    broken = leg(animations=(Animation("bad", 0.0, 1.0, refuse), animation(bow())))
    scene = opened(broken)
    assert scene.actors[0].clip is None
    assert [found.key for found in scene.diagnostics] == ["F002.misfit"]
    with pytest.raises(FormatError):
        opened(broken, animation="bad")
    assert opened(broken, animation="bow").actors[0].animation == 1


def test_info_lists_all_animations_without_reading_their_keys():
    actor = opened(animated_leg(), animation="bow").actors[0]
    found = describe_animations(actor)
    assert [(one["number"], one["name"], one["plays"]) for one in found] == [
        (1, "wave", False),
        (2, "bow", True),
    ]
    assert found[0]["range"] == [0.5, 2.5]
    assert animation_lines(found) == [
        "  animations 1  wave: 0.5 to 2.5 s",
        "             2* bow: 0 to 0.208 s",
    ]
