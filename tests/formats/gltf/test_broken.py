"""Hundreds of broken documents, each of which is read or refused in one line with the file name."""

from collections.abc import Iterable

import pytest
from formats.gltf.broken import changed, complete, truncated
from formats.gltf.files import source_of, warned

from viewer.diagnostics import Collector
from viewer.errors import FormatError, ViewerError
from viewer.formats import Source, read
from viewer.formats.gltf import read_nodes


def refusals(files: Iterable[bytes]) -> list[str]:
    """Read files with and without collecting errors; return the messages of the refused files."""
    found = []
    for data in files:
        kept = Source("a.gltf", data, diagnostics=Collector(keeps_errors=True))
        try:
            # A collected error does not prevent further errors from being found.
            read_nodes(kept)
        except FormatError as problem:
            kept.diagnostics.add(problem.diagnostic)
        try:
            content = read_nodes(source_of(data))
            for animation in content.animations:
                animation.read()
        except FormatError as problem:
            found.append(str(problem))
            assert kept.diagnostics.errors
    return found


def test_unchanged_document_is_valid():
    assert warned(complete()) == []
    assert len(read(source_of(complete())).figures) == 2


@pytest.mark.parametrize("seed", range(3))
def test_documents_with_changed_values_are_read_or_refused(seed):
    found = refusals(changed(seed, 80))
    assert 20 < len(found) < 80
    for line in found:
        assert "\n" not in line and ("a.gltf#/" in line or "a.gltf" not in line)
        assert len(line) < 400


def test_truncated_files_are_read_or_refused():
    for line in refusals(truncated()):
        assert line.startswith("a.gltf") and "\n" not in line


def test_changed_documents_are_read_as_figures_or_refused():
    for data in changed(9, 60):
        for keeps_errors in (False, True):
            source = Source("a.gltf", data, diagnostics=Collector(keeps_errors=keeps_errors))
            try:
                assert read(source).figures
            except ViewerError as problem:
                assert "\n" not in str(problem)
