"""An address at which no page can be served is one error, at once."""

from __future__ import annotations

import socket

import pytest

import duoglide as dg
from duoglide.cli.main import run
from duoglide.viewer.address import require_address, require_port

ELSEWHERE = "203.0.113.7"  # TEST-NET-3, nobody's


def test_an_address_of_another_computer_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("viser")
    assert run(["view", "--host", ELSEWHERE, "--port", "0"]) == 1
    assert "no address of this computer" in " ".join(capsys.readouterr().err.split())


def test_a_name_that_is_none_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def find_nothing(*_: object, **__: object) -> list[object]:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", find_nothing)
    with pytest.raises(dg.BusError, match="no such address: Name or service not known"):
        require_address("nobody", 0)


def test_a_busy_port_does_not_become_another_one(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("viser")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert run(["view", "--port", str(port)]) == 1
        assert f"port {port} of 127.0.0.1: the port is taken" in capsys.readouterr().err
    require_address("127.0.0.1", port)
    require_port("127.0.0.1", 0, port)
    with pytest.raises(dg.BusError, match="the port is taken"):
        require_port("127.0.0.1", port, port + 1)


def test_addresses_of_this_computer_are_taken() -> None:
    for host in ("127.0.0.1", "localhost", "0.0.0.0"):
        require_address(host, 0)
