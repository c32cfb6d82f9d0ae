"""The doctor as a command, on the accounts that there are."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from typing import Any

import pytest

import duoglide.control.host.doctor as examined
from duoglide.cli.main import run

NOBODY = 65534
RIGHTS = ("real-time priority", "locked memory")
COMMAND = [sys.executable, "-m", "duoglide", "doctor", "--seconds", "0", "--json"]
# Root's folders, where interpreter and checkout may lie, can be read, and nothing else can be done.
ORDINARY = [
    "setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups",
    "--inh-caps=-all,+dac_read_search", "--ambient-caps=-all,+dac_read_search",
]  # fmt: skip


def without_rights() -> None:
    """Give a process the limits that an account has that nobody has set up."""
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    resource.setrlimit(resource.RLIMIT_MEMLOCK, (8 << 20, 8 << 20))


def test_an_unprivileged_account_is_told_the_commands_and_gets_1() -> None:
    prefix = ORDINARY if os.getuid() == 0 else []
    if prefix and subprocess.run([*prefix, "true"], check=False, capture_output=True).returncode:
        pytest.skip("runs as root and may not become an ordinary user")
    done = subprocess.run(
        [*prefix, *COMMAND], capture_output=True, check=False, preexec_fn=without_rights
    )
    assert done.returncode == 1, done.stderr
    said = json.loads(done.stdout)
    found: dict[str, Any] = {finding["point"]: finding for finding in said["findings"]}
    assert said["ok"] is False
    for point in RIGHTS:
        assert found[point]["level"] == "bad"
        assert "sudo tee /etc/security/limits.d/" in found[point]["mend"]


def test_a_healthy_account_gets_0_and_nothing_to_do(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    unlimited = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
    monkeypatch.setattr(examined.resource, "getrlimit", lambda _: unlimited)
    assert run(["doctor", "--seconds", "0"]) == 0
    lines = capsys.readouterr().out.splitlines()
    for point in RIGHTS:
        (line,) = (line for line in lines if point in line)
        assert line.split()[0] == "ok"
        assert not any(line.startswith(f"{point}:") for line in lines)
    assert lines[-1] == "nothing is bad"
    assert max(map(len, lines)) <= 80
