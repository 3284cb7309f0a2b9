"""The manual: one Markdown page per task, shown by ``viewer help`` and by the Help menu."""

from __future__ import annotations

import re

from viewer.errors import ViewerError
from viewer.near_names import did_you_mean
from viewer.phrases import printable
from viewer.resources import resource

__all__ = ["PAGES", "page_text"]

PAGES = {
    "pictures": "pictures and videos without a screen",
    "course": "course files: .skel, .skin, .anim, .morph and .rig",
    "characters": "glTF, VRM and FBX: what is read, drawn and reported",
    "bodies": "body models: Anny, MHR, the SMPL family and PIG",
    "motion": "clips, BVH and AMASS: play, edit, retarget, convert",
    "captures": "EasyMocap recordings: people, gaps, keypoints, cameras",
    "video": "results of video motion capture: GVHMR, WHAM, 4D-Humans, TRAM and others",
    "weights": "inspect, check and compare weights and rigs",
    "rigging": "give a mesh the rig of a figure",
    "pages": "one HTML file that shows figures in any browser",
    "batches": "many files: batches, reports, grading, clusters",
    "window": "panels, tools and the mouse",
    "python": "the Python API",
    "live": "windows that other programs move: training loops, motion capture",
    "plugins": "packages that add formats, quantities and commands",
    "formats": "what is read and written, and what each format keeps",
    "gallery": "pictures of bundled data, and the commands that drew them",
    "troubleshooting": "installation, drawing, exit codes",
    "keys": "reference: keys and shortcuts",
    "codes": "reference: findings of lint",
    "json": "reference: data of --json and reports",
    "options": "reference: all commands and their options",
}
"""Pages in this folder, without their suffix, and what they are about."""

_COMMENT = re.compile(r"^<!--.*?-->\n+", re.MULTILINE)
_PICTURE = re.compile(r"^!\[.*\]\(.*\)\n+", re.MULTILINE)
_LINK = re.compile(r"\[([^\]]+)\]\((\w+)\.md\)")


def page_text(topic: str) -> str:
    """Return a page of ``PAGES`` as Markdown, without pictures and with topics instead of links."""
    if topic not in PAGES:
        near = did_you_mean(topic, PAGES)
        offer = f"{near} " if near else ""
        raise ViewerError(
            f'no help topic "{printable(topic, 60)}"; {offer}topics: {", ".join(PAGES)}'
        )
    text = resource("manual", f"{topic}.md").read_text("utf-8")
    text = _PICTURE.sub("", _COMMENT.sub("", text))
    return _LINK.sub(_topic_of_link, text)


def _topic_of_link(link: re.Match[str]) -> str:
    """Return the label of a link and the topic of its page, which is named once."""
    label, topic = link[1], link[2]
    return f"topic {topic}" if label == topic else f"{label} (topic {topic})"
