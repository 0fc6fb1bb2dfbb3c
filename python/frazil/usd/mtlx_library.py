"""MaterialX's library with Frazil's nodes in it, and how those are made from the one table of material inputs.

`python -m frazil.usd.mtlx_library` writes python/frazil/mtlx/frazil.mtlx; a test holds it equal to the table.
"""

from __future__ import annotations

import functools
from pathlib import Path
from xml.sax.saxutils import quoteattr

import MaterialX as mx

from .material_inputs import DENSITY_INPUTS, DISPLACEMENT_INPUTS, ICE_INPUTS, INFINITY, OVERLAY_INPUTS, MaterialInput

LIBRARY_FILE = Path(__file__).parents[1] / "mtlx" / "frazil.mtlx"
ICE_NODE = "ND_frazil_ice_surfaceshader"
OVERLAY_NODE = "ND_frazil_overlay"
DISPLACEMENT_NODE = "ND_frazil_displacement"
DENSITY_NODE = "ND_frazil_density"
# Inputs of frazil_ice that overlays are connected to, from below to the top.
OVERLAY_SLOTS = tuple(f"overlay{i}" for i in range(1, 9))

_TYPES = {
    "float": "float",
    "int": "integer",
    "color": "color3",
    "vector": "vector3",
    "bool": "boolean",
    "token": "string",
    "text": "string",
    "file": "filename",
    "floats": "floatarray",
    "colors": "color3array",
    "normal": "vector3",
}


@functools.cache
def library() -> mx.Document:
    """The standard library and Frazil's own; do not change it."""
    document = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), document)
    own = mx.createDocument()
    mx.readFromXmlFile(own, str(LIBRARY_FILE))
    document.importLibrary(own)
    return document


def library_text() -> str:
    """The text of mtlx/frazil.mtlx."""
    slots = [f'    <input name="{name}" type="overlayshader" uifolder="Overlays" />' for name in OVERLAY_SLOTS]
    slots.append('    <input name="density" type="densityshader" />')
    return "\n".join(
        [
            '<?xml version="1.0"?>',
            '<materialx version="1.39">',
            "  <!-- Made from the table of material inputs: python -m frazil.usd.mtlx_library -->",
            '  <typedef name="overlayshader" doc="A layer on frazil_ice." />',
            '  <typedef name="densityshader" doc="How dense frazil_ice is from place to place." />',
            *_definition(
                ICE_NODE,
                "frazil_ice",
                "surfaceshader",
                ICE_INPUTS,
                "Ice: a clear to translucent core under a glossy boundary, with overlays.",
                slots,
            ),
            *_definition(
                OVERLAY_NODE,
                "frazil_overlay",
                "overlayshader",
                OVERLAY_INPUTS,
                "Cracks, frost, bubbles, snow or dirt on ice.",
            ),
            *_definition(
                DENSITY_NODE,
                "frazil_density",
                "densityshader",
                DENSITY_INPUTS,
                "Clouds in ice: noise or an OpenVDB grid.",
            ),
            *_definition(
                DISPLACEMENT_NODE,
                "frazil_displacement",
                "displacementshader",
                DISPLACEMENT_INPUTS,
                "A height, or a vector, times a pattern.",
            ),
            "</materialx>",
            "",
        ]
    )


def _definition(
    name: str,
    node: str,
    kind: str,
    table: tuple[MaterialInput, ...],
    doc: str,
    more: list[str] | None = None,
) -> list[str]:
    return [
        f'  <nodedef name="{name}" node="{node}" nodegroup="pbr" doc={quoteattr(doc)}>',
        *(_input(row) for row in table),
        *(more or []),
        f'    <output name="out" type="{kind}" />',
        "  </nodedef>",
    ]


def _input(row: MaterialInput) -> str:
    kind = _TYPES[row.kind]
    attributes = {"name": row.name, "type": kind}
    if row.kind == "normal":
        attributes["defaultgeomprop"] = "Nworld"
    elif row.default is not None and row.default != ():
        attributes["value"] = _text(row.default)
    if row.choices:
        attributes["enum"] = ", ".join(row.choices)
        attributes["uniform"] = "true"
    if row.kind in ("float", "int", "color", "vector"):
        width = 3 if row.kind in ("color", "vector") else 1
        for key, value in (("uimin", row.minimum), ("uimax", row.maximum)):
            if abs(value) != INFINITY:
                attributes[key] = _text(tuple([value] * width) if width > 1 else value, row.kind == "int")
    if row.length_power == 1 and row.kind == "float":
        attributes |= {"unittype": "distance", "unit": "meter"}
    attributes["doc"] = row.meaning + {1: " (length)", -1: " (1/length)", 0: ""}[row.length_power]
    return "    <input " + " ".join(f"{key}={quoteattr(value)}" for key, value in attributes.items()) + " />"


def _text(value, is_integer: bool = False) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return value
    if isinstance(value, tuple):
        return ", ".join(_text(v) for v in value)
    return str(int(value)) if is_integer or isinstance(value, int) else f"{value:g}"


if __name__ == "__main__":
    LIBRARY_FILE.parent.mkdir(exist_ok=True)
    LIBRARY_FILE.write_text(library_text(), encoding="utf-8")
    print(LIBRARY_FILE)
