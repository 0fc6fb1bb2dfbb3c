"""A short round of the fuzzers: `make fuzz SECONDS=600` goes on for longer."""

import subprocess
import sys
from pathlib import Path

import pytest

import frazil as fz

FUZZ = Path(__file__).parents[1] / "fuzz" / "fuzz.py"
TARGETS = ("usd", "mesh", "arrays", "recipe", "lpe", "exr", "picture", "bake", "points", "checkpoint")


@pytest.mark.parametrize("target", TARGETS)
def test_no_input_crashes_or_hangs_a_reader(tmp_path, target):
    command = [sys.executable, str(FUZZ), "--seconds", "1", "--target", target, "--output", str(tmp_path)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=600)
    findings = "\n".join(path.read_text()[-2000:] for path in tmp_path.glob("*.txt"))
    assert result.returncode == 0, result.stdout + findings


def test_a_finding_is_kept_and_said(tmp_path):
    """A target that fails on purpose: the message of several lines that no user shall see."""
    script = (
        "import sys; sys.argv = ['fuzz.py', '--work', 'bad', '--seconds', '5', '--folder', sys.argv[1]]\n"
        f"sys.path.insert(0, {str(FUZZ.parent)!r})\n"
        "import fuzz, readers\n"
        "from hypothesis import strategies as st\n"
        "def fail(value, folder):\n"
        "    if len(value) > 3: raise RuntimeError('found')\n"
        "fuzz.make_targets = lambda folder: {'bad': readers.Target(st.binary(), fail, (OSError,))}\n"
        "sys.exit(fuzz.main())\n"
    )
    result = subprocess.run([sys.executable, "-c", script, str(tmp_path)], capture_output=True, text=True, timeout=300)
    assert result.returncode == 1
    assert "RuntimeError: found" in result.stderr


def test_the_stage_that_is_fuzzed_is_read_whole(tmp_path, monkeypatch):
    """Else only the parser of text would be fuzzed."""
    monkeypatch.syspath_prepend(FUZZ.parent)
    import readers

    (tmp_path / "seed.usda").write_text(readers.USDA)
    with pytest.warns(fz.FrazilWarning) as said:
        scene = fz.load_usd(tmp_path / "seed.usda")
    assert len(scene.objects) == 5
    assert len(scene.lights) == 2
    assert scene.camera.path == "/World/Camera"
    assert scene.render_settings.product.vars[0].source_type == "lpe"
    assert any(isinstance(material.model, fz.IceMaterial) and material.model.overlays for material in scene.materials)
    assert all("none.exr" in str(warning.message) for warning in said), [str(warning.message) for warning in said]
