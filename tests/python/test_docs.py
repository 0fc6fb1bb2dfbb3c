"""Every command and block of code in the documentation runs, and every page is in the site."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from frazil.grade_recipe import read_recipe

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
BLOCK = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)
RUN = ("python", "sh")
# What a page takes for granted: Python that makes the files and names which its code speaks of.
GIVEN = {
    "points": """
import numpy as np, trimesh, OpenImageIO as oiio, frazil as fz
ball = trimesh.creation.icosphere(2, 0.1)
grid = "".join(f"vt {(x + 1) / 2} {(z + 1) / 2}\\n" for x, y, z in ball.vertices / 0.1)
rows = "".join(f"f {a+1}/{a+1} {b+1}/{b+1} {c+1}/{c+1}\\n" for a, b, c in ball.faces)
open("teapot.obj", "w").write("".join(f"v {x} {y} {z}\\n" for x, y, z in ball.vertices) + grid + rows)
image = oiio.ImageBuf(oiio.ImageSpec(8, 8, 1, "float"))
oiio.ImageBufAlgo.fill(image, (0.5,))
image.write("density.exr")
eye = (0.0, 0.0, 2.0)
""",
    "usd": """
from pxr import Usd, UsdGeom
stage = Usd.Stage.CreateNew("scene.usda")
UsdGeom.Camera.Define(stage, "/World/Camera")
UsdGeom.Cube.Define(stage, "/World/Cube")
stage.Save()
""",
    "lighting": """
import numpy as np, frazil as fz
corners = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], np.float32)
mesh = fz.Mesh(corners, np.array([[0, 2, 1], [0, 3, 2]], np.int32))
points = fz.poisson_points(mesh, 0.2)
lights = [fz.Light(fz.DomeLight(), path="/Sky")]
""",
}
SLOW = {"formations", "tutorial_artist"}
PAGES = sorted(page.stem for page in DOCS.glob("*.md"))


def blocks(page: str) -> list[tuple[str, str, str]]:
    return BLOCK.findall((DOCS / f"{page}.md").read_text())


def run(command: list[str], folder: Path, text: str = "") -> None:
    environment = os.environ | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    result = subprocess.run(
        command, cwd=folder, env=environment, input=text, capture_output=True, text=True, timeout=900
    )
    assert result.returncode == 0, result.stdout[-2000:] + result.stderr[-2000:]


PAGES_WITH_CODE = [
    pytest.param(page, marks=[pytest.mark.slow] if page in SLOW else [])
    for page in PAGES
    if any(language in RUN for language, _, _ in blocks(page))
]


@pytest.mark.parametrize("page", PAGES_WITH_CODE)
def test_the_code_of_a_page_runs_from_top_to_bottom(tmp_path, page):
    """Python blocks that follow each other share their names; files have the names in their titles."""
    (tmp_path / "out").mkdir()
    python = [GIVEN.get(page, "")]
    for language, title, text in blocks(page):
        if title:
            (tmp_path / title).write_text(text)
        elif language == "python":
            python.append(text)
        elif language == "sh":
            run(["bash", "-euo", "pipefail"], tmp_path, text)
    if any(python):
        run([sys.executable, "-"], tmp_path, "\n".join(python))


@pytest.mark.parametrize("page", PAGES)
def test_recipes_on_a_page_are_recipes(tmp_path, page):
    for language, _, text in blocks(page):
        if language == "toml":
            (tmp_path / "recipe.toml").write_text(text)
            read_recipe(tmp_path / "recipe.toml")


def test_every_page_and_picture_is_shown():
    navigation = (ROOT / "mkdocs.yml").read_text()
    for page in PAGES:
        assert f" {page}.md" in navigation, page
    texts = "\n".join(page.read_text() for page in DOCS.glob("*.md"))
    for picture in (DOCS / "images").iterdir():
        assert f"images/{picture.name}" in texts, picture.name


def test_the_site_is_built_without_a_broken_link(tmp_path):
    mkdocs = shutil.which("mkdocs", path=str(Path(sys.executable).parent))
    if mkdocs is None:
        pytest.skip("mkdocs is not installed: make docs")
    run([mkdocs, "build", "--strict", "--quiet", "--site-dir", str(tmp_path / "site")], ROOT)
    assert (tmp_path / "site" / "index.html").is_file()
