"""The AOV table, the page that shows it, and what is asked for by name."""

from pathlib import Path

import numpy as np
import pytest

import frazil as fz
from frazil import _frazil
from frazil.aovs import chosen_aovs, layers_of

PAGE = Path(__file__).parents[2] / "docs" / "aovs.md"


def table_of_the_page() -> list[list[str]]:
    lines = [line for line in PAGE.read_text().splitlines() if line.startswith("| `")]
    return [[cell.strip(" `") for cell in line.strip("|").split("|")] for line in lines]


def test_page_shows_the_table():
    expected = []
    for aov in _frazil.aov_table():
        part = "sum" if aov["name"] == "beauty" else "yes" if aov["is_additive"] else "no"
        stored = "half" if aov["is_half"] else "float"
        made = "always" if aov["is_default"] else "on demand"
        expected.append([aov["name"], aov["channels"], part, stored, aov["filter"], made, aov["meaning"]])
    assert table_of_the_page() == expected


def test_unknown_names_offer_the_nearest_and_doubles_are_refused():
    with pytest.raises(KeyError, match=r"got 'translucency_rmap'. Did you mean 'translucency_ramp'"):
        chosen_aovs(["translucency_rmap"])
    with pytest.raises(ValueError, match=r"names must differ from each other, got 'uv' twice"):
        chosen_aovs(["uv", "Z", "uv"])
    with pytest.raises(KeyError, match="Did you mean 'crypto_object'"):
        fz.render(fz.Scene(), aovs=["crypto_objects"])


def test_layers_stand_for_their_groups_knots_and_ranks():
    names = ["beauty", "diffuse", "diffuse_key", "diffuse_default", "translucency", "translucency_key"]
    names += [
        "translucency_ramp0",
        "translucency_ramp0_key",
        "translucency_ramp1",
        "crypto_object00",
        "crypto_object01",
    ]
    film = fz.Film(
        {name: np.zeros((1, 1, 3), np.float32) for name in names}, {"frazil:light_groups": ["key", "default"]}
    )
    assert layers_of(["diffuse"], film) == ["diffuse", "diffuse_key", "diffuse_default"]
    assert layers_of(["translucency"], film) == ["translucency", "translucency_key"]
    assert layers_of(["translucency_ramp"], film) == names[6:9]
    assert layers_of(["crypto_object"], film) == names[9:]
    with pytest.raises(KeyError, match="layer"):
        layers_of(["uv"], film)
