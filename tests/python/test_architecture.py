"""The house keeps its order: who includes whom, what the page says of it, and which package is under test."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import frazil

ROOT = Path(__file__).parents[2]
CORE = ROOT / "src" / "frazil"
ORDER = ["base", "geometry", "points", "translucency", "lighting", "material", "render", "bindings"]


def core_files():
    return sorted([*CORE.rglob("*.h"), *CORE.rglob("*.cpp")])


def includes(path: Path) -> list[str]:
    return re.findall(r'^\s*#include\s+["<]([^">]+)[">]', path.read_text(), re.MULTILINE)


def wrong_includes(folder: str, names: list[str]) -> list[str]:
    """The includes of a file in `folder` that point to a folder below it, or to none that is known."""
    stages = [(name, name.split("/")[1]) for name in names if name.startswith("frazil/")]
    return [name for name, stage in stages if stage not in ORDER or ORDER.index(stage) > ORDER.index(folder)]


def test_folders_are_those_of_the_order():
    assert {path.name for path in CORE.iterdir() if path.is_dir()} == set(ORDER)


def test_the_check_sees_an_include_that_points_down():
    assert wrong_includes("points", ["vector", "frazil/base/vec.h", "frazil/points/side.h"]) == []
    assert wrong_includes("points", ["frazil/render/scene.h"]) == ["frazil/render/scene.h"]
    assert wrong_includes("lighting", ["frazil/material/ice.h"]) == ["frazil/material/ice.h"]
    assert wrong_includes("base", ["frazil/extra/x.h"]) == ["frazil/extra/x.h"]


@pytest.mark.parametrize("path", core_files(), ids=lambda path: str(path.relative_to(CORE)))
def test_includes_point_only_up(path):
    assert wrong_includes(path.relative_to(CORE).parts[0], includes(path)) == []


def test_python_is_only_in_the_bindings_and_usd_nowhere_in_the_core():
    foreign = {"nanobind": [], "Python.h": [], "pxr": []}
    for path in core_files():
        for name in includes(path):
            for library, users in foreign.items():
                if name.startswith(library):
                    users.append(path.relative_to(CORE).parts[0])
    assert set(foreign["nanobind"] + foreign["Python.h"]) <= {"bindings"}
    assert foreign["pxr"] == []


def test_the_page_shows_the_same_order():
    page = (ROOT / "docs" / "architecture.md").read_text()
    assert re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE) == ORDER


def test_the_page_names_every_dependency():
    page = (ROOT / "docs" / "architecture.md").read_text()
    setup = (ROOT / "scripts" / "setup.sh").read_text()
    packages = re.search(r"PACKAGES=\((.*)\)", setup)[1].split()
    for package in packages:
        assert package in ("build-essential", "pkg-config") or f"`{package}`" in page, package
    sys.path.insert(0, str(ROOT / "scripts"))
    try:
        from requirements import requirements
    finally:
        sys.path.pop(0)
    for line in requirements("build") + requirements("runtime"):
        name = re.match(r"[\w-]+", line)[0]
        assert name in ("cmake", "ninja") or name in page, name


def test_nothing_but_the_command_line_imports_the_command_line():
    for path in (ROOT / "python" / "frazil").rglob("*.py"):
        if "cli" not in path.relative_to(ROOT / "python" / "frazil").parts:
            assert not re.search(r"(from|import) +(frazil)?\.*cli\b", path.read_text()), path


def test_header_comments_say_what_a_file_is():
    for path in core_files():
        if path.suffix == ".h":
            assert path.read_text().startswith("// "), f"{path} begins without a header comment"


def test_the_committed_stub_is_the_generated_one(tmp_path):
    """A change of the module's face must be seen in the diff: `make stubs` writes it."""
    pytest.importorskip("nanobind", reason="the stub generator belongs to the build tools")
    command = [sys.executable, "-m", "nanobind.stubgen", "-q", "-m", "frazil._frazil", "-o", str(tmp_path / "a.pyi")]
    subprocess.run(command, check=True, timeout=300)
    committed = (ROOT / "python" / "frazil" / "_frazil.pyi").read_text()
    assert (tmp_path / "a.pyi").read_text() == committed, "the stub is old. Run make stubs."


def test_the_installed_package_is_that_of_this_tree():
    """An old or a foreign installation must not be what the tests look at."""
    package = Path(frazil.__file__).parent
    tree = ROOT / "python" / "frazil"
    for path in tree.rglob("*.py"):
        twin = package / path.relative_to(tree)
        assert twin.read_text() == path.read_text(), f"{twin} differs from {path}. Run make build."
