"""OSC packets: examples of the specification, and malformed ones."""

import random
import struct

import pytest

from viewer.live.osc import OscError, bundles, message_bytes, messages_of

# From the examples in the specification of OSC 1.0.
FREQUENCY = b"/oscillator/4/frequency\0,f\0\0\x43\xdc\0\0"
FOO = bytes.fromhex(
    "2f666f6f000000002c69697366660000000003e8ffffffff68656c6c6f0000003f9df3b640b5b22d"
)


def test_examples_of_the_specification_are_read():
    assert messages_of(FREQUENCY) == [("/oscillator/4/frequency", (440.0,))]
    ((address, arguments),) = messages_of(FOO)
    assert (address, arguments[:3]) == ("/foo", (1000, -1, "hello"))
    assert arguments[3:] == pytest.approx((1.234, 5.678), rel=1e-6)


def test_examples_of_the_specification_are_written():
    assert message_bytes("/oscillator/4/frequency", 440.0) == FREQUENCY
    assert message_bytes("/foo", 1000, -1, "hello", 1.234, 5.678) == FOO


def test_numbers_beyond_single_precision_are_limited():
    ((_, found),) = messages_of(message_bytes("/a", 1e39, -1e300))
    assert found == pytest.approx((3.4028235e38, -3.4028235e38))


def test_other_types_and_missing_tags_are_read():
    data = b"/a\0\0,TFNbd\0\0" + struct.pack(">i", 3) + b"xyz\0" + struct.pack(">d", 0.1)
    assert messages_of(data) == [("/a", (True, False, None, b"xyz", 0.1))]
    assert messages_of(b"/a\0\0") == [("/a", ())]


def test_bundles_may_be_nested():
    inner = b"#bundle\0" + bytes(8) + struct.pack(">i", len(FREQUENCY)) + FREQUENCY
    outer = b"#bundle\0" + bytes(8) + struct.pack(">i", len(inner)) + inner
    assert messages_of(outer + struct.pack(">i", len(FOO)) + FOO)[0][1] == (440.0,)
    for _ in range(4):
        inner = b"#bundle\0" + bytes(8) + struct.pack(">i", len(inner)) + inner
    with pytest.raises(OscError, match="at most 4 bundles"):
        messages_of(inner)


def test_long_bundles_are_divided():
    packets = bundles([FREQUENCY] * 100, 400)
    assert max(map(len, packets)) <= 400
    assert sum(len(messages_of(packet)) for packet in packets) == 100


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"/a\0",
        b"abc\0,\0\0\0",
        b"/abc",
        b"/a\0\0abc\0",
        b"/a\0\0,f\0\0",
        b"/a\0\0,s\0\0abcd",
        b"/a\0\0,q\0\0",
        b"/a\0\0,b\0\0\x7f\xff\xff\xff",
        b"/a\0\0,b\0\0\xff\xff\xff\xff",
        b"/a\0\0,\0\0\0\0\0\0\0",
        b"/\xff\0\0,\0\0\0",
        b"#bundle\0",
        b"#bundle\0" + bytes(8) + b"\0\0\0\x08",
        b"#bundle\0" + bytes(8) + b"\0\0\0\0",
        b"#bundle\0" + bytes(8) + b"\xff\xff\xff\xfc",
    ],
)
def test_malformed_packet_is_an_error(data):
    with pytest.raises(OscError):
        messages_of(data)


def test_random_packets_are_errors_of_one_kind():
    rng, n_errors = random.Random(2), 0
    whole = bundles([FREQUENCY, FOO])[0]
    for _ in range(5000):
        data = bytearray(whole if rng.random() < 0.8 else rng.randbytes(4 * rng.randrange(40)))
        for _ in range(rng.randrange(4)):
            if data:
                data[rng.randrange(len(data))] = rng.randrange(256)
        try:
            messages_of(bytes(data))
        except OscError:
            n_errors += 1
    assert n_errors > 1000
