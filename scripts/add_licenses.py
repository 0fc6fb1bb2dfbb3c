"""Put the licences of the libraries that auditwheel has copied into a wheel beside them.

Usage: add_licenses.py WHEEL
Debian keeps each package's licence in /usr/share/doc/PACKAGE/copyright; the wheel gets them as licenses/PACKAGE.txt in
its .dist-info folder.
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path


def packages_of(libraries: list[str]) -> set[str]:
    """The Debian packages that own libraries of these names; ``libtbb-1a2b3c.so.12`` is libtbb."""
    packages = set()
    for library in libraries:
        stem = re.sub(r"-[0-9a-f]{8}(?=\.so)", "", library)
        found = subprocess.run(["dpkg-query", "-S", f"*/{stem}*"], capture_output=True, text=True).stdout
        packages |= {line.split(":")[0] for line in found.splitlines() if not line.startswith("diversion")}
    return packages


def main(wheel: Path) -> None:
    with tempfile.TemporaryDirectory() as scratch:
        subprocess.run([sys.executable, "-m", "wheel", "unpack", "-d", scratch, wheel], check=True, capture_output=True)
        (folder,) = Path(scratch).iterdir()
        libraries = [path.name for path in (folder / "frazil.libs").glob("*.so*")]
        (info,) = folder.glob("*.dist-info")
        (info / "licenses").mkdir(exist_ok=True)
        for package in sorted(packages_of(libraries)):
            text = Path("/usr/share/doc", package, "copyright").read_text(errors="replace")
            (info / "licenses" / f"{package}.txt").write_text(text)
            print(f"add_licenses: {package}")
        pack = [sys.executable, "-m", "wheel", "pack", "-d", str(wheel.parent), str(folder)]
        subprocess.run(pack, check=True, capture_output=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
