"""The command line: what it writes, what it says, its exit status."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import fake_core
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import frazil as fz
from frazil.cli import main
from frazil.cli.frames import fill_pattern, parse_frames, parse_resolution
from frazil.cli.progress import make_progress


@pytest.fixture
def core(monkeypatch):
    core = fake_core.Core()
    fake_core.install(monkeypatch, core)
    return core


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.usda"
    path.write_text("#usda 1.0\n")
    return path


def run(capsys, *arguments):
    status = main([str(argument) for argument in arguments])
    output, errors = capsys.readouterr()
    return SimpleNamespace(status=status, output=output, errors=errors)


def assert_misused(result, *words):
    assert result.status == 2
    assert result.errors.startswith("frazil: error: ")
    assert result.errors.count("\n") == 1
    for word in words:
        assert word in result.errors


# ---- render ----------------------------------------------------------------------------------------------------------


def test_render_writes_exr_and_png_and_says_where(capsys, core, scene, tmp_path):
    result = run(capsys, "render", scene, "-o", tmp_path / "a.exr", "--resolution", "24x12", "--progress", "none")
    assert result.status == 0
    assert result.output == f"frazil: wrote {tmp_path}/a.exr and {tmp_path}/a.png\n"
    assert result.errors == ""
    film = fz.Film.load(tmp_path / "a.exr")
    assert (film.width, film.height) == (24, 12)
    assert set(film) == {row["name"] for row in fake_core.aov_table()}
    assert film.metadata["frazil:camera"] == "/World/Camera"
    world_to_camera = np.reshape(film.metadata["worldToCamera"], (4, 4))
    np.testing.assert_allclose(world_to_camera @ fake_core.CAMERA_TO_WORLD, np.eye(4), atol=1e-6)
    assert film.metadata["frazil:frame"] == "default"
    assert film.metadata["frazil:scene"] == str(scene)
    assert json.loads(film.metadata["frazil:objects"]) == ["/World/Ice", "/World/Rock"]
    assert re.fullmatch(r"Frazil \d+\.\d+\.\d+", film.metadata["Software"])
    assert re.fullmatch(r"\d{4}:\d\d:\d\d \d\d:\d\d:\d\d", film.metadata["DateTime"])


def test_options_reach_the_core(capsys, core, scene, tmp_path):
    given = (
        "--samples 7 --seed 4294967295 --threads 1 --max-bounces 2 --spacing 0.25 --spacing-scale 2 --bake-samples 9 "
        "--tolerance 0.5 --estimator sum --camera /Cam --compression dwaa --no-png --quiet"
    ).split()
    result = run(capsys, "render", scene, "-o", tmp_path / "a.exr", "--resolution", "4x4", *given)
    assert (result.status, result.output, result.errors) == (0, "", "")
    expected = {
        "samples": 7,
        "seed": 2**32 - 1,
        "threads": 1,
        "max_bounces": 2,
        "spacing": 0.25,
        "spacing_scale": 2.0,
        "bake_samples": 9,
        "tolerance": 0.5,
        "estimator": "sum",
    }
    assert {key: core.options[key] for key in expected} == expected
    metadata = fz.Film.load(tmp_path / "a.exr").metadata
    assert metadata["frazil:camera"] == "/Cam"
    assert metadata["compression"] == "dwaa"
    assert sorted(os.listdir(tmp_path)) == ["a.exr", "scene.usda"]


def test_frames_are_rendered_in_order_into_numbered_files(capsys, core, scene, tmp_path):
    result = run(
        capsys, "render", scene, "-o", tmp_path / "a.####.exr", "--frames", "-1-3x2", "--resolution", "4x4", "--quiet"
    )
    assert result.status == 0
    assert core.frames == [-1, 1, 3]
    names = [f"a.{number}.{kind}" for number in ("-0001", "0001", "0003") for kind in ("exr", "png")]
    assert sorted(os.listdir(tmp_path)) == sorted([*names, "scene.usda"])
    assert fz.Film.load(tmp_path / "a.0003.exr").metadata["frazil:frame"] == 3.0


def test_stats_are_written(capsys, core, scene, tmp_path):
    options = ["--resolution", "4x4", "--quiet", "--stats", tmp_path / "s.json"]
    assert run(capsys, "render", scene, "-o", tmp_path / "a.exr", *options).status == 0
    stats = json.loads((tmp_path / "s.json").read_text())
    (frame,) = stats["frames"]
    assert re.fullmatch(r"\d+\.\d+\.\d+", stats["version"])
    assert (frame["points"], frame["nodes"], frame["dropped_samples"]) == (10, 3, 2)
    assert set(frame["seconds"]) == {"load", "points", "render", "save"}
    assert frame["peak_memory"] > 1e6


def test_chosen_layers_only(capsys, core, scene, tmp_path):
    options = ["--resolution", "4x4", "--quiet", "--aov", "Z,N", "--aov", "coverage"]
    assert run(capsys, "render", scene, "-o", tmp_path / "a.exr", *options).status == 0
    assert set(fz.Film.load(tmp_path / "a.exr")) == {"beauty", "Z", "N", "coverage"}


def test_the_resolution_of_the_stage_is_the_default(capsys, core, scene, tmp_path, monkeypatch):
    def load_usd(path, frame=None, camera=None, rest_frame=None, materials=None, look=None):
        return fake_core.scene(resolution=(30, 20))

    monkeypatch.setattr(fz.usd, "load_usd", load_usd)
    assert run(capsys, "render", scene, "-o", tmp_path / "a.exr", "-q").status == 0
    assert (core.options["width"], core.options["height"]) == (30, 20)


# ---- misuse ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--resolution 0x0", ["--resolution", "from 1x1 to 65536x65536", "got '0x0'"]),
        ("--resolution 12", ["--resolution", "WIDTHxHEIGHT"]),
        ("--resolution -3x4", ["--resolution", "WIDTHxHEIGHT"]),
        ("--resolution 99999x1", ["--resolution", "65536"]),
        ("--samples 0", ["--samples", "got 0"]),
        ("--samples x", ["--samples"]),
        ("--threads -1", ["--threads", "got -1"]),
        ("--seed -1", ["--seed"]),
        ("--tolerance 0", ["--tolerance", "must be > 0"]),
        ("--tolerance nan", ["--tolerance", "finite"]),
        ("--spacing -1", ["--spacing", "must be >= 0"]),
        ("--spacing-scale inf", ["--spacing-scale"]),
        ("--estimator noisefree", ["--estimator", "Did you mean noise_free?"]),
        ("--compression zipz", ["--compression", "Did you mean zip"]),
        ("--progress farms", ["--progress", "Did you mean farm?"]),
        ("--aov translucancy", ["--aov", "Did you mean translucency?"]),
        ("--frames 1-10", ["-o", "must have a place for the frame's number"]),
        ("--frames 10-1", ["--frames", "upwards"]),
        ("--frames 1-999999999", ["--frames", "at most"]),
        ("--frames abc", ["--frames", "A-BxSTEP"]),
        ("--frame 1 --frames 1-2", ["--frame", "together"]),
        ("--frame inf", ["--frame", "finite"]),
        ("--png a.jpg", ["--png", ".png"]),
        ("--png a.png --no-png", ["--png", "together"]),
        ("--resoluton 4x4", ["--resoluton", "--resolution"]),
    ],
)
def test_misuse_is_one_line_and_status_2(capsys, core, scene, tmp_path, options, words):
    assert_misused(run(capsys, "render", scene, "-o", tmp_path / "a.exr", *options.split()), *words)
    assert core.options is None
    assert os.listdir(tmp_path) == ["scene.usda"]


def test_misuse_of_the_command_itself(capsys, core, scene, tmp_path):
    assert_misused(run(capsys, "rendr"), "rendr", "render")
    assert_misused(run(capsys), "Missing command")
    assert_misused(run(capsys, "render", scene), "--output")
    assert_misused(run(capsys, "render", scene, "-o", tmp_path / "a.tif"), ".exr")
    assert_misused(run(capsys, "render", scene, "-o", tmp_path / "a.####.exr"), "--frame")


# ---- failure ---------------------------------------------------------------------------------------------------------


def assert_failed(result, *words):
    assert result.status == 1
    assert result.errors.startswith("frazil: error: ")
    assert result.errors.count("\n") == 1
    for word in words:
        assert word in result.errors


def test_a_missing_scene_fails(capsys, core, tmp_path):
    assert_failed(run(capsys, "render", tmp_path / "no.usda", "-o", tmp_path / "a.exr"), "no.usda: file must exist")


@pytest.mark.parametrize("option", ["-o", "--png", "--stats"])
def test_unwritable_output_is_told_before_the_render(capsys, core, scene, tmp_path, option):
    outputs = {"-o": tmp_path / "a.exr", "--png": tmp_path / "a.png", "--stats": tmp_path / "s.json"}
    outputs[option] = tmp_path / "no" / outputs[option].name
    arguments = [part for pair in outputs.items() for part in pair]
    assert_failed(run(capsys, "render", scene, *arguments), "folder must exist", "Create it first")
    assert core.options is None


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (ValueError("/World/Ice: sigma_a must be >= 0, got -1."), ["/World/Ice: sigma_a"]),
        (OSError("tex.png: must be an image"), ["tex.png"]),
        (FileNotFoundError(2, "No such file or directory", "x.usd"), ["x.usd: No such file"]),
        (MemoryError(), ["memory", "--spacing"]),
        (MemoryError("resolution: picture must fit. Lower --resolution."), ["resolution: picture must fit"]),
        (RuntimeError("Embree: no device\ncould be made"), ["Embree: no device could be made"]),
    ],
)
def test_what_the_core_refuses_is_one_line_and_status_1(capsys, core, scene, tmp_path, monkeypatch, error, words):
    def render(*_, **__):
        raise error

    monkeypatch.setattr(fz._frazil, "render", render)
    result = run(capsys, "render", scene, "-o", tmp_path / "a.exr", "--resolution", "4x4", "--progress", "none")
    assert_failed(result, *words)
    assert os.listdir(tmp_path) == ["scene.usda"]


def test_warnings_are_single_lines_told_once(capsys, core, scene, tmp_path, monkeypatch):
    import warnings

    def load_usd(path, frame=None, camera=None, rest_frame=None, materials=None, look=None):
        warnings.warn("/World/Cloth: NurbsPatch is not supported.\nLeft out.", fz.FrazilWarning, stacklevel=2)
        warnings.warn("something in a library", DeprecationWarning, stacklevel=2)
        return fake_core.scene(frame)

    monkeypatch.setattr(fz.usd, "load_usd", load_usd)
    options = ["--resolution", "4x4", "--frames", "1-3", "--quiet"]
    result = run(capsys, "render", scene, "-o", tmp_path / "a.#.exr", *options)
    assert result.status == 0
    assert result.errors == "frazil: warning: /World/Cloth: NurbsPatch is not supported. Left out.\n"


# ---- stopping --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_stops_and_leaves_nothing_half_written(capsys, monkeypatch, scene, tmp_path, number, status):
    steps = []

    def on_step(stage, step):
        steps.append(step)
        if len(steps) == 2:
            os.kill(os.getpid(), number)
        time.sleep(0.02)

    fake_core.install(monkeypatch, fake_core.Core(steps=1000, on_step=on_step))
    result = run(capsys, "render", scene, "-o", tmp_path / "a.exr", "--resolution", "4x4", "--progress", "none")
    assert result.status == status
    assert result.errors == "frazil: error: stopped. Nothing half-written is left.\n"
    assert len(steps) < 50
    assert os.listdir(tmp_path) == ["scene.usda"]


# ---- progress --------------------------------------------------------------------------------------------------------


def test_farm_progress_is_lines_of_whole_percents_that_grow_to_100(capsys, core, scene, tmp_path):
    options = ["--resolution", "4x4", "--frames", "1-2", "--progress", "farm", "--quiet"]
    result = run(capsys, "render", scene, "-o", tmp_path / "a.#.exr", *options)
    percents = [int(re.fullmatch(r"ALF_PROGRESS (\d+)%", line)[1]) for line in result.output.splitlines()]
    assert percents == sorted(set(percents))
    assert percents[-1] == 100
    assert len(percents) > 10


def test_a_bar_without_a_terminal_is_a_few_lines(capsys, core, scene, tmp_path):
    result = run(capsys, "render", scene, "-o", tmp_path / "a.exr", "--resolution", "4x4")
    lines = result.errors.splitlines()
    assert 3 < len(lines) <= 11
    assert all(re.fullmatch(r"frazil: +\d+% \w+", line) for line in lines)


@given(st.lists(st.tuples(st.sampled_from(["load", "points", "bake", "render", "odd"]), st.floats(-1, 2)), max_size=30))
def test_overall_progress_never_shrinks_and_stays_in_range(reports):
    values = []
    reporter = make_progress("none", frames=2)
    reporter.show = lambda stage, value: values.append(value)
    for stage, fraction in reports:
        reporter(stage, fraction)
    assert values == sorted(values)
    assert all(0 <= value <= 0.5 for value in values)


# ---- names and numbers -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "frames"),
    [("5", [5]), ("1-3", [1, 2, 3]), ("-5--3", [-5, -4, -3]), ("1-10x4", [1, 5, 9]), ("7,1-2,7", [7, 1, 2])],
)
def test_frame_ranges(text, frames):
    assert parse_frames(text) == frames


@pytest.mark.parametrize(
    ("name", "filled"),
    [
        ("a.####.exr", "a.0012.exr"),
        ("a.#.exr", "a.12.exr"),
        ("a.$F4.exr", "a.0012.exr"),
        ("a.$F.exr", "a.12.exr"),
        ("a.<F6>.exr", "a.000012.exr"),
        ("a.%05d.exr", "a.00012.exr"),
        ("a.exr", "a.exr"),
    ],
)
def test_patterns(tmp_path, name, filled):
    assert fill_pattern(tmp_path / name, 12.0) == tmp_path / filled


@given(st.text())
def test_any_text_is_a_resolution_or_refused(text):
    try:
        width, height = parse_resolution(text)
    except ValueError:
        return
    assert 1 <= width <= 65536
    assert 1 <= height <= 65536


# ---- info ------------------------------------------------------------------------------------------------------------


def test_info_of_an_exr(capsys, core, tmp_path):
    fz.Film(fake_core.layers(), {"frazil:seed": 3}).save(tmp_path / "a.exr", "piz")
    result = run(capsys, "info", tmp_path / "a.exr")
    assert result.status == 0
    assert "EXR, 16x9, piz" in result.output
    assert re.search(r"translucency +translucency\.R translucency\.G translucency\.B \(half\)", result.output)
    assert re.search(r"Z +Z \(float\)", result.output)
    assert re.search(r"frazil:seed +3", result.output)


STAGE = """#usda 1.0
(
    metersPerUnit = 0.01
    upAxis = "Z"
    startTimeCode = 1
    endTimeCode = 24
)
def Xform "World"
{
    def Cube "Box"
    {
        double size = 2
    }
    def Camera "Shot"
    {
    }
    def DomeLight "Sky"
    {
    }
    def Material "Blue"
    {
        token outputs:surface.connect = </World/Blue/Surface.outputs:surface>
        def Shader "Surface"
        {
            uniform token info:id = "UsdPreviewSurface"
            token outputs:surface
        }
    }
}
"""


def test_info_of_a_stage(capsys, tmp_path):
    (tmp_path / "a.usda").write_text(STAGE)
    result = run(capsys, "info", tmp_path / "a.usda")
    assert result.status == 0
    for text in ("0.01 m, Z up", "1-24 at 24 per second", "(-1, -1, -1) to (1, 1, 1)", "/World/Shot (Camera)"):
        assert text in result.output
    assert "/World/Sky (DomeLight)" in result.output
    assert "/World/Blue (UsdPreviewSurface)" in result.output


def test_info_of_a_stage_with_a_broken_reference_warns_in_one_line(capfd, tmp_path):
    (tmp_path / "a.usda").write_text('#usda 1.0\ndef Xform "A" (references = @missing.usda@)\n{\n}\n')
    status = main(["info", str(tmp_path / "a.usda")])
    errors = capfd.readouterr().err
    assert status == 0
    assert re.fullmatch(r"frazil: warning: .*a\.usda: .*missing\.usda.*\n", errors)


def test_info_of_points(capsys, tmp_path):
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment spacing 0.5\nelement vertex 12\nproperty float x\nend_header\n"
    )
    (tmp_path / "a.ply").write_bytes(header.encode() + bytes(48))
    result = run(capsys, "info", tmp_path / "a.ply")
    assert result.status == 0
    assert re.search(r"vertex +12", result.output)
    assert re.search(r"spacing +0\.5", result.output)


@pytest.mark.parametrize("name", ["a.exr", "a.usda", "a.usdc", "a.usdz", "a.ply", "a.txt", "none.exr"])
@pytest.mark.parametrize("content", [b"", b"\x00\xff\x00 nonsense", b"ply\n" * 5000])
def test_info_of_nonsense_fails_in_one_line(capfd, tmp_path, name, content):
    if not name.startswith("none"):
        (tmp_path / name).write_bytes(content)
    status = main(["info", str(tmp_path / name)])
    errors = capfd.readouterr().err
    assert status == 1
    assert errors.startswith(f"frazil: error: {tmp_path / name}: ")
    assert errors.count("\n") == 1


# ---- the program -----------------------------------------------------------------------------------------------------


def frazil(*arguments, **options):
    command = [sys.executable, "-m", "frazil.cli", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, **options)


def test_help_names_every_option_with_unit_and_default():
    result = frazil("render", "--help", env=os.environ | {"COLUMNS": "200"})
    assert result.returncode == 0
    for text in ("--spacing", "METRES", "default: 32", "default: 0.01", "<F4>", "A-B[xSTEP]", "960x540"):
        assert text in result.stdout


def test_help_imports_neither_usd_nor_openimageio():
    heavy = "[name for name in ('pxr', 'OpenImageIO') if name in sys.modules]"
    code = f"import sys, frazil.cli as cli; cli.main(['--help']); print({heavy})"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert result.stdout.splitlines()[-1] == "[]", result.stderr


def test_version_is_that_of_the_package():
    from importlib.metadata import version

    assert frazil("--version").stdout == f"frazil {version('frazil')}\n"


def test_a_closed_pipe_is_no_traceback(tmp_path):
    (tmp_path / "a.usda").write_text(STAGE)
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "frazil.cli", "info", str(tmp_path / "a.usda")]
    result = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, text=True, timeout=120)
    os.close(writing)
    assert "Traceback" not in result.stderr
