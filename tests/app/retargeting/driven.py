"""A scene whose figure is driven by a capture with an unrecognised elbow name and a tail."""

from rigs.retargeting.two_people import BODY, HIK, figure_of, moving

from viewer.rigs.retargeting.drive import Drive
from viewer.rigs.retargeting.driven_clip import driven_clip
from viewer.rigs.scene import Actor, Scene

NAMES = {"RightForeArm": "rEllbogen_x"}


def driven_scene() -> Scene:
    table = {
        NAMES.get(name, name): (NAMES.get(parent, parent), at) for name, (parent, at) in HIK.items()
    }
    table["tail"] = "Hips", (0, 95, -30)
    figure = figure_of(BODY, "body")
    drive = Drive(moving(figure_of(table, "capture"), angle=0.5))
    clip, _ = driven_clip(drive, figure)
    return Scene([Actor(figure, clip=clip, drive=drive)])
