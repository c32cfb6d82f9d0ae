"""Fuzz the readers of programs and machine files, and print what came of it.

``python tests/benchmarks/fuzz_readers.py [COUNT] [SEED]``: COUNT inputs for each reader, 20000
unless said otherwise. Whatever leaves a reader and is no DuoglideError is shown, and the exit code
is 1.
"""

from __future__ import annotations

import platform
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "fuzz"))
from test_programs import SEEDS, run


def main() -> int:
    """Fuzz every reader."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    print(f"{count} inputs each, seed {seed}, Python {platform.python_version()}")
    print("file          read  refused  escaped   kept  reached  longest  slowest   time")
    escaped = 0
    for name in SEEDS:
        start = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            got = run(name, Path(folder), count, seed)
        print(
            f"{name:<12} {got.read:>5}  {got.refused:>7}  {len(got.escaped):>7}  {len(got.kept):>5}"
            f"  {got.reached:>7}  {got.longest:>7}  {1e3 * got.slowest:>4.0f} ms"
            f"  {time.perf_counter() - start:>4.0f} s",
            flush=True,
        )
        for data, error in got.escaped[:5]:
            print(f"  {data!r:.400}: {error!r:.400}")
        escaped += len(got.escaped)
    return 1 if escaped else 0


if __name__ == "__main__":
    raise SystemExit(main())
