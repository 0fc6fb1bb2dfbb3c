"""Ice from its physics: tables, bubbles, impurities, presets."""

from __future__ import annotations

import numpy as np
import pytest

import frazil as fz
from frazil import optics


def test_tables_hold_the_cited_figures():
    """4 pi k/wavelength of Warren & Brandt's k at 400, 500, 600 and 700 nm; both agree from 600 nm up."""
    warren, picard = optics.absorption("warren2008"), optics.absorption("picard2016")
    for nm, k in ((400, 2.365e-11), (500, 5.889e-10), (600, 5.730e-9), (700, 2.900e-8)):
        at = np.flatnonzero(optics.WAVELENGTHS_NM == nm)[0]
        assert warren[at] == pytest.approx(4 * np.pi * k / (nm * 1e-9), rel=5e-3)
    np.testing.assert_array_equal(warren[25:], picard[25:])
    assert 20 < picard[5] / warren[5] < 30


def test_ice_is_blue_and_flat_spectra_stay_flat():
    red, green, blue = optics.to_rgb(optics.absorption())
    assert red > 3 * green > 10 * blue > 0
    np.testing.assert_allclose(optics.to_rgb(np.full(41, 0.7)), 0.7, rtol=1e-12)


def test_bubbles_and_impurities_add_up():
    assert optics.bubble_scattering(1e9, 1e-4) == pytest.approx(np.pi * 10 * 2 * 0.14)
    soot = optics.impurity_absorption("soot", 1e-6)
    assert soot[20] == pytest.approx(1e-6 * 917 * 7500)
    clean, dirty = optics.ice(1e9, 1e-4), optics.ice(1e9, 1e-4, soot=1e-8)
    np.testing.assert_allclose(dirty.sigma_a - clean.sigma_a, 0.01 * optics.to_rgb(soot), rtol=1e-3)


def test_the_two_tables_are_those_of_the_papers_everywhere():
    """Decades of the blue minimum: Warren's below 8e-4/m, Picard's never under 0.015/m; both rise to red."""
    warren, picard = optics.absorption("warren2008"), optics.absorption("picard2016")
    assert warren[:6].max() < 8e-4
    assert picard.min() > 0.015
    assert optics.WAVELENGTHS_NM[picard.argmin()] == pytest.approx(420, abs=15)
    assert (np.diff(warren[5:]) > 0).all()


def test_colour_matching_integrates_to_white():
    """The curves weigh a flat spectrum alike, and narrow lines by their colour: red at 650 nm, blue at 450 nm."""
    lines = np.eye(41)
    red, blue = (optics.to_rgb(lines[np.flatnonzero(optics.WAVELENGTHS_NM == nm)[0]]) for nm in (650, 450))
    assert red.argmax() == 0
    assert blue.argmax() == 2
    np.testing.assert_allclose(sum(optics.to_rgb(line) for line in lines), 1.0, rtol=1e-12)


def test_algae_take_blue_and_red_and_leave_green():
    red, green, blue = optics.to_rgb(optics.impurity_absorption("algae", 1e-8))
    assert blue > 2 * green
    peak = optics.impurity_absorption("algae", 1e-8)[optics.WAVELENGTHS_NM == 680][0]
    assert peak > 2 * optics.impurity_absorption("algae", 1e-8)[optics.WAVELENGTHS_NM == 600][0]
    assert red > 0


def test_info_lists_every_medium(capsys):
    from frazil.cli import main

    assert main(["info", "--media"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "(1/m)" in lines[0]
    assert {line.split()[0] for line in lines[1:]} == set(optics.media())
    assert main(["info"]) == 2
    assert main(["info", "--media", "a.usda"]) == 2


def test_every_medium_makes_a_profile():
    media = optics.media()
    assert {"blue_glacier_ice", "breath_frost", "marble"} <= media.keys()
    for medium in media.values():
        albedo = fz.Dipole(medium).albedo
        assert ((albedo > 0) & (albedo <= 1)).all()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: optics.absorption("snow"), "data must be one of warren2008, picard2016"),
        (lambda: optics.preset("fire"), "name must be one of blue_glacier_ice"),
        (lambda: optics.measured("fire"), "name must be one of apple"),
        (lambda: optics.ice(-1, 1e-4), "per_m3 must be >= 0"),
        (lambda: optics.ice(1, float("nan")), "radius must be >= 0"),
        (lambda: optics.ice(1, 1e-4, soot=-1), "mass_fraction must be >= 0"),
        (lambda: optics.impurity_absorption("pollen", 1), "kind must be one of soot, dust, algae"),
        (lambda: optics.ice(1, 1e-4, algae=float("inf")), "mass_fraction must be >= 0"),
        (lambda: optics.to_rgb(np.ones(3)), "spectrum must have shape"),
        (lambda: optics.to_rgb(np.full(41, np.nan)), "to_rgb: spectrum must be finite"),
    ],
)
def test_bad_input(call, message):
    with pytest.raises(ValueError, match=message):
        call()
