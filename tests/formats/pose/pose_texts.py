"""Functions that read pose files for tests."""

from faults import warnings_of

from viewer.formats import Source, pose


def read(path):
    source = Source.open(path)
    return pose.read(source), warnings_of(source.diagnostics)
