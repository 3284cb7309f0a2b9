"""Trial motion: each joint in turn bends within its limits and returns to the initial pose."""

import numpy as np
from app.tiny import write_rig

import viewer
from viewer.app.rigging.results import trial_clip
from viewer.rig.motion.clip import sample


def test_joints_bend_one_after_another_and_return(tmp_path):
    actor = viewer.load(*write_rig(tmp_path)).actors[0]
    skeleton, pose = actor.figure.skeleton, actor.pose
    clip = trial_clip(skeleton, pose)
    assert len(clip.channels) == sum(skeleton.parents >= 0)
    for channel in clip.channels:
        assert skeleton.parents[skeleton.dof_joints[channel.target]] >= 0
        low, high = skeleton.dof_limits[channel.target]
        assert (low <= channel.values).all() and (channel.values <= high).all()
        assert np.ptp(channel.values) > 0.0
    for time in (clip.start, clip.end):
        posed = pose.copy()
        sample(clip, skeleton, time, posed)
        np.testing.assert_allclose(posed.dofs, pose.dofs, atol=1e-12)
