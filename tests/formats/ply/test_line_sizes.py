import pytest

from viewer.formats.ply import elements
from viewer.formats.ply.elements import line_sizes


@pytest.mark.parametrize("piece", [1, 3, 8, 1 << 18])
def test_line_sizes_are_the_word_counts_of_lines_with_words(monkeypatch, piece):
    monkeypatch.setattr(elements, "_PIECE", piece)
    text = b"head 9\n 1 2\r\n\r\n\t\n3\r4 5 6 \v7\f8\n\n-1.5e3\n  9  9"
    lines = text.replace(b"\r", b"\n").split(b"\n")
    expected = [len(line.split()) for line in lines if line.split()]
    assert line_sizes(text, 0).words.tolist() == expected == [2, 2, 1, 5, 1, 2]
    assert line_sizes(text, 7).words.tolist() == expected[1:]
    assert line_sizes(b"", 0).words.tolist() == line_sizes(b" \n", 0).words.tolist() == []


@pytest.mark.parametrize("piece", [1, 3, 8, 1 << 18])
def test_offsets_divide_the_words_of_lines(monkeypatch, piece):
    monkeypatch.setattr(elements, "_PIECE", piece)
    text = b"head 9\n 1 2\r\n\r\n\t\n3\r4 5 6 \v7\f8\n\n-1.5e3\n  9  9"
    found = line_sizes(text, 7)
    for line in range(6):
        words = text[7 : found.offset(line)].split()
        assert len(words) == sum([2, 1, 5, 1, 2][:line])
        # No word is divided.
        assert text[7:].split() == words + text[found.offset(line) :].split()
