"""The product in worlds that are not the developer's: each takes the tour as a process of its own.

An ordinary user with a home that cannot be written to, locales, no /dev/shm, no docstrings. A world
that cannot be made here is skipped, and says why.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

TOUR = Path(__file__).with_name("tour.py")
NOBODY = 65534
USER = ["setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups"]
# Root's folders, where interpreter and checkout may lie, can be read, and nothing else can be done.
READS = ["--inh-caps=-all,+dac_read_search", "--ambient-caps=-all,+dac_read_search"]
HIDDEN = ["unshare", "--mount", *(["--map-root-user"] if os.getuid() else [])]
HIDDEN += ["sh", "-c", 'mount -t tmpfs -o ro none /dev/shm && exec "$@"', "sh"]


def take_tour(folder: Path, *options: str, prefix: Sequence[str] = (), **env: str) -> str:
    """Run the tour and return what it says on stderr; all of it is shown where it fails."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("LC_")}
    command = [*prefix, sys.executable, *options, str(TOUR), str(folder)]
    done = subprocess.run(
        command, env={**kept, **env}, capture_output=True, check=False, timeout=600
    )
    assert done.returncode == 0, (done.stdout + done.stderr).decode(errors="replace")[-3000:]
    return done.stderr.decode(errors="replace")


def can(*command: str) -> bool:
    """Whether a command is there and does what it says."""
    return (
        bool(shutil.which(command[0]))
        and not subprocess.run(command, capture_output=True, check=False).returncode
    )


def test_without_docstrings_and_with_ascii_alone(tmp_path: Path) -> None:
    ascii_alone = {"LANG": "C", "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    take_tour(tmp_path, "-OO", **ascii_alone)


@pytest.fixture
def open_folder() -> Iterator[Path]:
    """A folder that other users reach, which those of pytest are not."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        yield Path(name)


def test_an_ordinary_user_with_a_home_that_cannot_be_written_to(open_folder: Path) -> None:
    home, work, temporary = (open_folder / name for name in ("home", "work", "temporary"))
    for folder in (home, work, temporary):
        folder.mkdir()
    home.chmod(0o555)
    prefix = []
    if os.getuid() == 0:
        if not can(*USER, *READS, "true"):
            pytest.skip("runs as root and may not become an ordinary user")
        prefix = [*USER, *READS]
        for folder in (work, temporary):
            os.chown(folder, NOBODY, NOBODY)
    env = {"HOME": str(home), "XDG_CACHE_HOME": str(home / ".cache"), "XDG_RUNTIME_DIR": ""}
    said = take_tour(work, prefix=prefix, TMPDIR=str(temporary), **env)
    assert list(home.iterdir()) == []
    if prefix:  # who has no right to it is told, once, in one line
        (warning,) = (line for line in said.splitlines() if "real-time priority" in line)
        assert warning.startswith("duoglide: warning: ") and len(warning) <= 80


def test_without_dev_shm(tmp_path: Path) -> None:
    if not can(*HIDDEN, "true"):
        pytest.skip("may not mount anything over /dev/shm here")
    assert can(*HIDDEN, "sh", "-c", "! touch /dev/shm/duoglide-was-here")
    take_tour(tmp_path, prefix=HIDDEN)


def test_in_germany(tmp_path: Path) -> None:
    german = tmp_path / "de_DE.UTF-8"
    if not can("localedef", "-i", "de_DE", "-f", "UTF-8", str(german)):
        pytest.skip("Debian's package locales is not installed: no German here")
    (tmp_path / "work").mkdir()
    env = {"LANG": "de_DE.UTF-8", "LOCPATH": str(tmp_path), "TOUR_DECIMAL_POINT": ","}
    take_tour(tmp_path / "work", **env)
