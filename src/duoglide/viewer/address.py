"""Where a page may be served: what cannot be is refused, before viser waits for it or evades it."""

from __future__ import annotations

import errno
import socket

from duoglide.errors import BusError

_WORDS = {
    errno.EADDRNOTAVAIL: (
        "that is no address of this computer; 127.0.0.1 serves it alone, 0.0.0.0 whoever reaches it"
    ),
    errno.EADDRINUSE: "the port is taken; --port 0 takes a free one",
    errno.EACCES: "ports below 1024 need a privilege; 8080 needs none",
}


def require_address(host: str, port: int) -> None:
    """Refuse an address at which no page can be served.

    Args:
        host: Address or name of this computer.
        port: TCP port; 0 for any that is free.

    Raises:
        BusError: It is not this computer's, or the port is taken, or not to be had.
    """
    try:
        places = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        for family, _, _, _, place in places:
            socket.create_server(place[:2], family=family).close()
    except socket.gaierror as error:
        raise _refusal(host, port, f"no such address: {error.strerror}") from error
    except OSError as error:
        words = _WORDS.get(error.errno or 0, error.strerror or str(error))
        raise _refusal(host, port, words) from error


def require_port(host: str, asked: int, given: int) -> None:
    """Refuse another port than the one that was asked for: it was taken a moment ago.

    Raises:
        BusError: It is another one.
    """
    if asked not in (0, given):
        raise _refusal(host, asked, _WORDS[errno.EADDRINUSE])


def _refusal(host: str, port: int, words: str) -> BusError:
    return BusError(f"cannot serve the page on port {port} of {host}: {words}")
