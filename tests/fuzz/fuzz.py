"""Fuzz the readers: `python tests/fuzz/fuzz.py --seconds 60 [--target usd ...]`.

Each target runs in a process of its own under hypothesis, which shrinks what it finds. A crash or an input that takes
longer than --hang seconds ends it. Findings are kept in --output and named; the exit status is 1 where there are some.
"""

import argparse
import hashlib
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from readers import make_targets, run_quietly


def work(name: str, seconds: float, seed: int, folder: Path) -> int:
    """The process of one target; what it is at is in `folder`/current."""
    from hypothesis import HealthCheck, Phase, given, settings
    from hypothesis import seed as seeded

    target = make_targets(folder)[name]
    current, counter = folder / "current", folder / "count"
    end = time.monotonic() + seconds
    count = 0

    def attempt(value) -> None:
        nonlocal count
        if time.monotonic() > end:
            return
        current.write_bytes(pickle.dumps(value))
        run_quietly(target, value, folder)
        count += 1

    round_number = 0
    while time.monotonic() < end:
        options = settings(
            max_examples=200,
            deadline=None,
            database=None,
            suppress_health_check=list(HealthCheck),
            phases=(Phase.generate, Phase.shrink),
        )
        seeded(seed + 1000 * round_number)(options(given(target.strategy)(attempt)))()
        round_number += 1
    counter.write_text(str(count))
    return 0


def watch(name: str, seconds: float, seed: int, hang: float, output: Path) -> str | None:
    """Run one target; what was found, None where nothing was."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        command = [sys.executable, __file__, "--work", name, "--folder", scratch]
        command += ["--seconds", str(seconds), "--seed", str(seed)]
        with (folder / "said").open("wb") as said:
            process = subprocess.Popen(command, stdout=said, stderr=said, env=os.environ | {"PYTHONFAULTHANDLER": "1"})
        current = folder / "current"
        found = None
        started = time.time()
        while process.poll() is None:
            time.sleep(0.1)
            since = current.stat().st_mtime if current.exists() else started
            if time.time() - since > hang + (0 if current.exists() else 120):
                process.kill()
                process.wait()
                found = f"an input takes over {hang:g} s"
                break
        if found is None and process.returncode != 0:
            lines = (folder / "said").read_text(errors="replace").strip().splitlines()
            found = f"exit status {process.returncode}: {lines[-1] if lines else ''}"
        if found is None:
            print(f"{name}: {(folder / 'count').read_text()} inputs, nothing found", flush=True)
            return None
        output.mkdir(parents=True, exist_ok=True)
        content = current.read_bytes() if current.exists() else b""
        kept = output / f"{name}-{hashlib.sha1(content).hexdigest()[:10]}"
        kept.with_suffix(".pickle").write_bytes(content)
        shutil.copy(folder / "said", kept.with_suffix(".txt"))
        print(f"{name}: {found} ({kept}.txt)", flush=True)
        return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=10.0, help="for each target")
    parser.add_argument("--target", action="append", help="only this one; may be given again")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--hang", type=float, default=60.0, help="seconds that one input may take")
    parser.add_argument("--output", type=Path, default=Path("out/fuzz"), help="the folder for findings")
    parser.add_argument("--work", help=argparse.SUPPRESS)
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--again", type=Path, help="run one finding (.pickle) of a --target once more")
    options = parser.parse_args()
    if options.work:
        return work(options.work, options.seconds, options.seed, options.folder)
    with tempfile.TemporaryDirectory() as scratch:
        names = list(make_targets(Path(scratch)))
        if options.again:
            value = pickle.loads(options.again.read_bytes())
            run_quietly(make_targets(Path(scratch))[options.target[0]], value, Path(scratch))
            return 0
    for name in options.target or []:
        if name not in names:
            parser.error(f"--target must be one of {', '.join(names)}, got {name}")
    found = [
        watch(name, options.seconds, options.seed, options.hang, options.output) for name in options.target or names
    ]
    return 1 if any(found) else 0


if __name__ == "__main__":
    sys.exit(main())
