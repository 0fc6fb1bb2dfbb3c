"""What the README says to type works, and what it shows is there."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
FIRST_SCREEN = README.split("## What it does not do")[0]


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


def run(command: list[str], folder: Path) -> subprocess.CompletedProcess:
    environment = os.environ | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=600)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A place where out/glacier.usda is a coarse one."""
    folder = tmp_path_factory.mktemp("readme")
    (folder / "out").mkdir()
    command = [sys.executable, str(ROOT / "examples" / "glacier.py"), "-o", "out/glacier.usda", "--detail", "0.2"]
    result = run(command, folder)
    assert result.returncode == 0, result.stderr
    return folder


def test_the_first_screen_has_what_it_must():
    assert FIRST_SCREEN.count("![") == 1
    python = [line for line in blocks("python")[0].splitlines() if line]
    assert len(python) <= 8
    for target in re.findall(r"^make (\w+)", "\n".join(blocks("sh")), re.MULTILINE):
        assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), re.MULTILINE)


def test_links_and_pictures_exist_and_are_small():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        if not target.startswith("http"):
            assert (ROOT / target).is_file(), target
            assert (ROOT / target).stat().st_size < 400_000, target


@pytest.mark.slow
def test_the_python_lines_run(folder):
    result = run([sys.executable, "-c", blocks("python")[0]], folder)
    assert result.returncode == 0, result.stderr
    assert (folder / "out" / "ice.exr").stat().st_size > 10_000
    assert (folder / "out" / "ice.png").stat().st_size > 1_000


@pytest.mark.slow
def test_the_command_lines_run(folder):
    lines = [line for block in blocks("sh") for line in block.splitlines() if line.startswith("frazil ")]
    assert lines
    for line in lines:
        result = run(shlex.split(line), folder)
        assert result.returncode == 0, result.stderr


def test_commands_in_the_text_exist(tmp_path):
    for command in sorted(set(re.findall(r"`frazil (\w+)", README))):
        result = run(["frazil", command, "--help"], tmp_path)
        assert result.returncode == 0, result.stderr


def test_the_version_is_in_the_changelog():
    version = re.search(r'^version = "(.*)"', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)[1]
    assert re.search(rf"^## {re.escape(version)}\b", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
