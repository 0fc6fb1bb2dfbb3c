"""What the talk's figures are made with: the teapot, sheets of pictures, and how the race counts noise and bias."""

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import frazil as fz

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "examples"), str(ROOT / "bench")]
import figures  # noqa: E402
import race  # noqa: E402
import teapot  # noqa: E402


def test_the_teapot_is_whole():
    mesh = teapot.teapot(6)
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    np.testing.assert_allclose([low[1], high[1]], [0, 3.15], atol=1e-6)
    np.testing.assert_allclose([low[0], high[0]], [-3, 3.434], atol=0.02)
    np.testing.assert_allclose(low[2], -high[2], atol=1e-6)
    # Patches meet: welded, every inner edge is shared by two triangles, and what is open is rims and seats.
    _, welded = np.unique(mesh.positions.round(4), axis=0, return_inverse=True)
    faces = welded.reshape(-1)[mesh.triangles]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts <= 2).all()
    assert (counts == 1).mean() < 0.1
    # Outside is outside: normals of the belly point away from the axis.
    corners = mesh.positions[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    middle = corners.mean(axis=1)
    belly = (np.abs(middle[:, 1] - 1.2) < 0.3) & (np.hypot(middle[:, 0], middle[:, 2]) > 1.6)
    belly &= np.hypot(middle[:, 0], middle[:, 2]) < 2.05
    outward = (normals[:, [0, 2]] * middle[:, [0, 2]]).sum(axis=1)
    assert (outward[belly] > 0).mean() > 0.9


def test_poisson_points_are_more_even_on_the_teapot():
    mesh = teapot.teapot(6)
    regular = fz.tessellated_points(mesh, 0.4)
    poisson = teapot.poisson_like(mesh, regular)
    assert len(poisson) == pytest.approx(len(regular), rel=0.005)
    a, b = fz.point_statistics(regular, mesh), fz.point_statistics(poisson, mesh)
    assert b.gap / b.min_distance <= 1 + 1e-6 < a.gap / a.min_distance / 3
    assert b.gap < 0.8 * a.gap


def test_sheets_have_every_panel(tmp_path):
    colors = [(255, 0, 0), (0, 255, 0), (0, 0, 255)]
    panels = [(f"panel {i}", Image.new("RGB", (40, 30), color)) for i, color in enumerate(colors)]
    figures.write_sheet(tmp_path / "sheet.png", panels, 2)
    sheet = np.asarray(Image.open(tmp_path / "sheet.png").convert("RGB"))
    for color in colors:
        assert (np.abs(sheet.astype(int) - color).max(axis=2) < 8).sum() >= 40 * 30 * 0.9


def test_the_race_takes_noise_off_the_bias():
    random = np.random.default_rng(0)
    sky, lamp = [0.3, 0.4, 0.5], 12.0
    truth = np.full((60, 60, 3), sky)
    truth[:4, :4] = lamp
    truth[10:50, 10:50] = 1.0

    def noisy(level, gain):
        picture = truth.copy()
        picture[10:50, 10:50] = gain + level * random.normal(size=(40, 40, 3))
        return {"picture": picture, "cpu": 2.0, "wall": 1.0, "peak": 10**8}

    pairs = {
        "mitsuba volpath": [noisy(0.05, 1.0), noisy(0.05, 1.0)],
        "frazil": [noisy(0.005, 1.03), noisy(0.005, 1.03)],
    }
    scene = {"env": sky, "radiance": lamp}
    rows = {row["renderer"]: row for row in race.compare("m", 60, pairs, dict.fromkeys(pairs, 8), scene)}
    assert rows["mitsuba volpath"]["noise"] == pytest.approx(0.05, rel=0.1)
    assert rows["mitsuba volpath"]["to 1%"] == pytest.approx(2.0 * 25, rel=0.2)
    assert rows["frazil"]["bias"] == pytest.approx(0.03, rel=0.15)
    assert rows["frazil"]["to 1%"] == 2.0  # below that noise already: nothing is scaled
