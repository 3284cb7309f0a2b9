"""The files of a plug-in that ``viewer new-plugin`` writes: a format and a scalar quantity."""
