"""Layers by name, what goes into the EXR, and the stop of a render."""

import json
import os
import signal
import threading
import time

import fake_core
import numpy as np
import pytest

import frazil as fz
from frazil import exr


@pytest.fixture(autouse=True)
def _core(monkeypatch):
    fake_core.install(monkeypatch, fake_core.Core())


@pytest.fixture
def film():
    return fz.Film(fake_core.layers(), {"frazil:seed": 3, "frazil:objects": ["/World/Ice", "/World/Rock"]})


def test_layers_are_the_arrays_themselves(film):
    assert film["Z"] is film.layers["Z"]
    assert (film.width, film.height, len(film)) == (16, 9, 8)
    assert "P" in film
    assert "Q" not in film


def test_an_unknown_layer_offers_the_nearest(film):
    with pytest.raises(KeyError, match="got 'translucancy'. Did you mean 'translucency'"):
        film["translucancy"]


def test_layers_of_several_sizes_are_refused():
    with pytest.raises(ValueError, match="arrays of one size"):
        fz.Film({"beauty": np.zeros((2, 2, 4), np.float32), "Z": np.zeros((3, 2, 1), np.float32)})
    with pytest.raises(ValueError, match="one or more"):
        fz.Film({})


def test_saved_layers_come_back(tmp_path, film):
    film.save(tmp_path / "a.exr", "zip")
    read = fz.Film.load(tmp_path / "a.exr")
    assert set(read) == set(film)
    for row in fake_core.aov_table():
        expected = film[row["name"]]
        if row["is_half"]:
            expected = expected.astype(np.float16).astype(np.float32)
        np.testing.assert_array_equal(read[row["name"]], expected, err_msg=row["name"])


def test_additive_layers_sum_to_the_beauty_within_half_precision(tmp_path, film):
    film.save(tmp_path / "a.exr")
    read = fz.Film.load(tmp_path / "a.exr")
    np.testing.assert_allclose(read["translucency"] + read["specular"], read["beauty"][:, :, :3], rtol=2**-9)


def test_halves_and_floats_by_choice(tmp_path, film):
    film.save(tmp_path / "a.exr", half_layers=["P"], float_layers=["beauty"])
    layers = exr.read_header(tmp_path / "a.exr")[2]
    assert set(layers["P"].values()) == {"half"}
    assert set(layers["beauty"].values()) == {"float"}
    with pytest.raises(KeyError, match="Did you mean 'beauty'"):
        film.save(tmp_path / "b.exr", float_layers=["beuty"])
    assert os.listdir(tmp_path) == ["a.exr"]


def test_some_layers_only(tmp_path, film):
    film.save(tmp_path / "a.exr", layers=["beauty", "Z"])
    assert list(fz.Film.load(tmp_path / "a.exr")) == ["beauty", "Z"]


def test_metadata_is_in_the_header(tmp_path, film):
    film.save(tmp_path / "a.exr")
    metadata = fz.Film.load(tmp_path / "a.exr").metadata
    assert metadata["frazil:seed"] == 3
    assert json.loads(metadata["frazil:objects"]) == ["/World/Ice", "/World/Rock"]


def test_bright_layers_warn_and_stay_float(tmp_path, film):
    film["specular"][0, 0] = 1e5
    with pytest.warns(fz.FrazilWarning, match=r"a\.exr: layer specular has values beyond half"):
        film.save(tmp_path / "a.exr")
    assert fz.Film.load(tmp_path / "a.exr")["specular"][0, 0, 0] == 1e5


# ---- render ----------------------------------------------------------------------------------------------------------


def test_options_reach_the_core(monkeypatch):
    core = fake_core.Core()
    fake_core.install(monkeypatch, core)
    film = fz.render(fake_core.scene(), resolution=(20, 10), samples=5, seed=9, threads=2, spacing=0.1, estimator="sum")
    assert (film.width, film.height) == (20, 10)
    expected = {"samples": 5, "seed": 9, "threads": 2, "spacing": 0.1, "estimator": "sum"}
    assert {key: core.options[key] for key in expected} == expected
    assert film.metadata["frazil:dropped_samples"] == 2
    assert film.stats["points"] == 10
    assert film.stats["peak_memory"] > 1e6


def test_progress_is_told():
    told = []
    fz.render(fake_core.scene(), resolution=(4, 4), progress=lambda stage, fraction: told.append((stage, fraction)))
    assert told[0] == ("points", 0.25)
    assert told[-1] == ("render", 1.0)


def test_what_progress_raises_stops_the_render():
    def refuse(stage, fraction):
        raise LookupError(stage)

    with pytest.raises(LookupError, match="points"):
        fz.render(fake_core.scene(), resolution=(4, 4), progress=refuse)


def test_interrupt_stops_at_the_next_step(monkeypatch):
    steps = []

    def on_step(stage, step):
        steps.append(stage)
        if len(steps) == 3:
            os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.02)

    fake_core.install(monkeypatch, fake_core.Core(steps=1000, on_step=on_step))
    # A shell starts what it puts into the background with this signal ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            fz.render(fake_core.scene(), resolution=(4, 4))
    finally:
        signal.signal(signal.SIGINT, before)
    assert len(steps) < 50
    assert not any(thread.name == "frazil render" for thread in threading.enumerate())


def test_a_picture_that_cannot_fit_is_refused():
    with pytest.raises(MemoryError, match=r"picture must fit .* got 65536x65536.* Lower --resolution"):
        fz.render(fake_core.scene(), resolution=(65536, 65536))
