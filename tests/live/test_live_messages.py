"""Messages, their limits, and objects in them; malformed ones are errors of one kind."""

import contextlib
import io
import json
import random
import struct

import numpy as np
import pytest

import viewer
from viewer.errors import ViewerError
from viewer.live.messages import (
    FIRST,
    BrokenStreamError,
    Limits,
    Message,
    MessageError,
    packed,
    read,
)
from viewer.live.objects import pack, unpack


def framed(header, body=b"", mark=b"SKL1"):
    """Write a message without code of the viewer."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return mark + struct.pack("<IQ", len(text), len(body)) + text + body


class Stream:
    """Bytes to receive; ``asked`` is the largest number that was asked for at once."""

    def __init__(self, data):
        self._stream, self.asked = io.BytesIO(data), 0

    def __call__(self, size):
        self.asked = max(self.asked, size)
        data = self._stream.read(size)
        if len(data) < size:
            raise EOFError
        return data


def test_message_has_the_documented_bytes():
    message = Message("pose", {"actor": 3}, [np.array([[1.0, -2.0]]), np.array([7], np.int32)])
    header = {"actor": 3, "do": "pose", "arrays": [["<f8", [1, 2]], ["<i4", [1]]]}
    assert packed(message) == framed(header, struct.pack("<ddi", 1.0, -2.0, 7))


def test_message_is_read_as_it_was_written():
    header = {"do": "x", "name": "Ä", "arrays": [["<f4", [2]], ["|b1", [1, 2]], ["<f8", [0, 3]]]}
    found = read(Stream(framed(header, struct.pack("<ff??", 0.5, 1.5, True, False))))
    assert (found.do, found.facts) == ("x", {"name": "Ä"})
    assert [each.tolist() for each in found.arrays] == [[0.5, 1.5], [[True, False]], []]


def test_two_messages_follow_each_other():
    stream = Stream(framed({"do": "a"}) + framed({"do": "b"}))
    assert [read(stream).do, read(stream).do] == ["a", "b"]


@pytest.mark.parametrize(
    "data",
    [
        framed({"do": "a"}, mark=b"HTTP"),
        b"SKL1" + struct.pack("<IQ", 5000, 0),
        b"SKL1" + struct.pack("<IQ", 10, 1),
    ],
)
def test_sizes_are_refused_before_anything_is_received(data):
    stream = Stream(data)
    with pytest.raises(BrokenStreamError):
        read(stream, FIRST)
    assert stream.asked == 16


@pytest.mark.parametrize(
    ("header", "body"),
    [
        (b"{", b""),
        (b"\xff\xfe", b""),
        (b'{"do": NaN}', b""),
        (b"[" * 5000, b""),
        ([], b""),
        ({"do": 3}, b""),
        ({"do": "a", "arrays": 3}, b""),
        ({"do": "a", "arrays": [["<f8"]]}, b""),
        ({"do": "a", "arrays": [["O", [1]]]}, b"12345678"),
        ({"do": "a", "arrays": [["<f8", [-1]]]}, b""),
        ({"do": "a", "arrays": [["<f8", [1.0]]]}, b"12345678"),
        ({"do": "a", "arrays": [["<f8", [1 << 39, 1 << 39]]]}, b"12345678"),
        ({"do": "a", "arrays": [["<f8", [2]]]}, b"12345678"),
        ({"do": "a", "arrays": [["<f8", [1] * 9]]}, b"12345678"),
        ({"do": "a", "arrays": [["|b1", [1]]]}, b"\x02"),
        ({"do": "a"}, b"1"),
    ],
)
def test_malformed_message_is_an_error_after_which_the_next_is_read(header, body):
    stream = Stream(framed(header, body) + framed({"do": "next"}))
    with pytest.raises(MessageError) as problem:
        read(stream)
    assert not isinstance(problem.value, BrokenStreamError)
    assert read(stream).do == "next"


@pytest.mark.parametrize("value", [None, True, "3", float("inf")])
def test_number_is_finite(value):
    with pytest.raises(MessageError, match="distance"):
        Message("camera", {"distance": value}).number("distance")


def test_arrays_have_the_expected_shape_and_are_finite():
    message = Message("pose", {}, [np.zeros((2, 3)), np.array([np.nan])])
    assert message.array(0, (None, 3)).shape == (2, 3)
    with pytest.raises(MessageError, match=r"expected shape \(N, 4\), found \(2, 3\)"):
        message.array(0, (None, 4))
    with pytest.raises(MessageError, match="finite"):
        message.array(1, (1,))
    with pytest.raises(MessageError, match="expected array 2, found 2"):
        message.array(2, (1,))


def test_random_bytes_are_errors_and_cost_little_memory():
    rng, limits = random.Random(5), Limits(2000, 4000)
    header = {"do": "pose", "actor": 1, "arrays": [["<f8", [3, 2]], ["|b1", [2]]]}
    whole = framed(header, struct.pack("<6d??", *range(6), True, False))
    for _ in range(3000):
        data = bytearray(whole if rng.random() < 0.8 else rng.randbytes(rng.randrange(200)))
        for _ in range(rng.randrange(4)):
            if data:
                data[rng.randrange(len(data))] = rng.randrange(256)
        stream = Stream(bytes(data))
        with contextlib.suppress(MessageError, EOFError):
            assert isinstance(read(stream, limits), Message)
        assert stream.asked <= 4000


def test_actor_arrives_as_it_was():
    fox = viewer.load().actors[0]
    fox["head"] = [0.3, 0.1, 0.0]
    arrays = []
    told = pack(fox, arrays)
    message = read(Stream(packed(Message("put", {"object": told}, arrays))))
    found = unpack(message.facts["object"], message.arrays)
    assert np.array_equal(found.vertices(), fox.vertices())
    assert found.figure.skeleton.names == fox.figure.skeleton.names
    assert found.figure.mesh.materials[0].name == fox.figure.mesh.materials[0].name
    found["head"] = [0.0, 0.0, 0.0]  # its pose can be changed


@pytest.mark.parametrize(
    "told",
    [
        {"array": 3},
        {"array": -1},
        {"kind": "Path", "fields": {}},
        {"kind": "Figure", "fields": {"name": "a"}},
        {"kind": "Skin", "fields": {"weights": "abc"}},
        {"kind": "Mesh", "fields": {"nonsense": 1}},
        {"map": [[1, 2, 3]]},
        {"number": "1e9"},
        {"set": 3},
        {"__class__": "os.system"},
    ],
)
def test_other_objects_are_refused(told):
    with pytest.raises(ViewerError):
        unpack(told, [np.zeros(3)])


def test_function_cannot_be_sent():
    with pytest.raises(ViewerError, match="found function"):
        pack(framed, [])


def test_random_changes_of_an_actor_are_errors_of_one_kind():
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    figure = viewer.figure(square, [[0, 1, 2, 3]], weights=np.eye(4)[:, :2], joints=square[:2])
    arrays, rng = [], random.Random(7)
    text = json.dumps(pack(viewer.Actor(figure), arrays))
    n_errors = 0
    for _ in range(600):
        letters = list(text)
        for _ in range(rng.randrange(1, 4)):
            letters[rng.randrange(len(letters))] = rng.choice('0123456789{}[]",:abfkrs-')
        try:
            told = json.loads("".join(letters))
        except ValueError:
            continue
        try:
            unpack(told, arrays)
        except ViewerError:
            n_errors += 1
    assert n_errors > 10
