"""The AOV table and the page that shows it say the same."""

from pathlib import Path

from frazil import _frazil

PAGE = Path(__file__).parents[2] / "docs" / "rendering.md"


def rows_of_the_page() -> list[list[str]]:
    lines = PAGE.read_text().split("## Layers")[1].split("## Ice")[0].splitlines()
    rows = [[cell.strip(" `") for cell in line.strip("|").split("|")] for line in lines if line.startswith("| `")]
    assert rows
    return rows


def test_page_shows_the_table():
    expected = []
    for aov in _frazil.aov_table():
        part = "sum" if aov["name"] == "beauty" else "yes" if aov["is_additive"] else "no"
        stored = "half" if aov["is_half"] else "float"
        expected.append([aov["name"], aov["channels"], part, stored, aov["meaning"]])
    assert rows_of_the_page() == expected
