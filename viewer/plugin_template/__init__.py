"""The files of a plug-in that ``viewer new-plugin`` writes: a format, a quantity and a check."""
