"""Handshake by which a program and a window prove that both know the token, without sending it.

::

    program   hello   version, nonce
    window    ok      nonce, HMAC-SHA256(token, "window" + the program's nonce + the window's)
    program   prove   HMAC-SHA256(token, "program" + both nonces), owns
    window    ok

Nonces are 32 random bytes; they and the proofs are hexadecimal. The program checks the window's
proof before it sends its own, so whoever listens on the port of a window that crashed learns
nothing. The words keep either side from returning the other's proof.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
import socket
from typing import Literal

from viewer.errors import ViewerError
from viewer.live.connection_file import Connection
from viewer.live.messages import FIRST, VERSION, Message, MessageError, packed, read, receiver
from viewer.phrases import printable

_NONCE = 32  # bytes
_SECONDS = 15.0  # in which a window must answer


class NotTheWindowError(ViewerError):
    """What listens on the port does not know the token, or speaks another protocol."""


class Greeting:
    """A window's side of the handshake with one program."""

    def __init__(self, token: str) -> None:
        self._token, self._nonces = token, b""
        self.is_over = False
        """Whether the program has proved that it knows the token."""
        self.owns = False
        """Whether the window closes when this program leaves."""

    def answer(self, message: Message) -> Message:
        """Answer the next message; ``MessageError`` for one that does not let the program in."""
        if not self._nonces:
            return self._hello(message)
        if message.do != "prove":
            raise MessageError(f"expected prove, found {printable(message.do, 60)}")
        _check(message, self._token, "program", self._nonces)
        self.is_over, self.owns = True, message.facts.get("owns") is True
        return Message("ok", {})

    def _hello(self, message: Message) -> Message:
        if message.do != "hello":
            raise MessageError(f"expected hello, found {printable(message.do, 60)}")
        version = message.index("version")
        if version != VERSION:
            raise MessageError(
                f"expected version {VERSION} of the protocol, found {version}: "
                "use the same version of viewer in the program and for the window"
            )
        own = secrets.token_bytes(_NONCE)
        self._nonces = _nonce(message) + own
        proof = _proof(self._token, "window", self._nonces)
        return Message("ok", {"version": VERSION, "nonce": own.hex(), "proof": proof})


def join(known: Connection, owns: bool = False, seconds: float = _SECONDS) -> socket.socket:
    """Return a connection to a window, which both sides trust.

    Raises ``OSError`` if nothing listens or answers, ``NotTheWindowError`` if something else does,
    and ``ViewerError`` if the window refuses the program.
    """
    stream = socket.create_connection(("127.0.0.1", known.port), seconds)
    try:
        receive, own = receiver(stream, seconds), secrets.token_bytes(_NONCE)

        def ask(do: str, **facts: object) -> Message:
            stream.sendall(packed(Message(do, facts)))
            answer = read(receive, FIRST)
            if answer.do == "error":
                raise ViewerError(f"the window refused: {printable(answer.text('text'), 300)}")
            return answer

        try:
            answer = ask("hello", version=VERSION, nonce=own.hex())
            nonces = own + _nonce(answer)
            _check(answer, known.token, "window", nonces)
        except MessageError as problem:
            raise NotTheWindowError(str(problem)) from None
        ask("prove", proof=_proof(known.token, "program", nonces), owns=owns)
    except EOFError:
        stream.close()
        raise ConnectionResetError("closed by the window") from None
    except BaseException:
        stream.close()
        raise
    return stream


def is_alive(known: Connection) -> bool:
    """Return whether a window listens there; one that crashed leaves its file behind.

    Another program may have got the port since. A window that is busy, full or of another version
    is alive.
    """
    try:
        join(known, seconds=1.0).close()
    except (ConnectionRefusedError, NotTheWindowError):
        return False
    except (OSError, ViewerError):
        return True
    return True


def _nonce(message: Message) -> bytes:
    text = message.text("nonce")
    try:
        found = bytes.fromhex(text)
    except ValueError:
        found = b""
    if len(found) != _NONCE:
        raise MessageError(f"nonce: expected {_NONCE} bytes, found {printable(text, 60)}")
    return found


def _proof(token: str, side: Literal["window", "program"], nonces: bytes) -> str:
    return hmac.new(token.encode(), side.encode() + nonces, hashlib.sha256).hexdigest()


def _check(message: Message, token: str, side: Literal["window", "program"], nonces: bytes) -> None:
    """Refuse a message whose sender does not know the token."""
    found, expected = message.text("proof"), _proof(token, side, nonces)
    if not hmac.compare_digest(found.encode("utf-8", "replace"), expected.encode()):
        raise MessageError("wrong token")
