"""The picture that a render returns: named layers, how they were made, and their way to disk.

Model: layers are views of the renderer's own memory, driven by the core's AOV table; the additive ones sum to the
beauty. Units: by layer, see `frazil info` or docs/architecture.md. Row 0 is on top.
Not: changing colours after the render (grading.py).
"""

import json
import os
import re
import warnings
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from typing import Any

import numpy as np

from . import exr, image
from .aovs import aov_table
from .warning import FrazilWarning

__all__ = ["Film"]


class Film:
    """Layers of one picture.

    Parameters
    ----------
    layers : mapping of str to (H, W, C) float32
        By AOV name; not copied.
    metadata : mapping, optional
        What the EXR's header shall say: camera, frame, seed, settings. Keys as in `Film.save`.
    stats : mapping, optional
        Counts and seconds of the render.

    Examples
    --------
    >>> import numpy as np, frazil as fz
    >>> film = fz.Film({"beauty": np.zeros((4, 6, 4), np.float32)})
    >>> film.width, film.height, list(film)
    (6, 4, ['beauty'])
    """

    def __init__(
        self,
        layers: Mapping[str, np.ndarray],
        metadata: Mapping[str, Any] | None = None,
        stats: Mapping[str, Any] | None = None,
    ):
        if not layers:
            raise ValueError("Film: layers must be one or more, got none.")
        shapes = {np.shape(array)[:2] for array in layers.values()}
        if len(shapes) != 1 or any(np.ndim(array) != 3 for array in layers.values()):
            raise ValueError(f"Film: layers must be (H, W, C) arrays of one size, got sizes {sorted(shapes)}.")
        self.layers: dict[str, np.ndarray] = dict(layers)
        self.metadata: dict[str, Any] = dict(metadata or {})
        self.stats: dict[str, Any] = dict(stats or {})

    @property
    def height(self) -> int:
        """Rows of pixels."""
        return next(iter(self.layers.values())).shape[0]

    @property
    def width(self) -> int:
        """Columns of pixels."""
        return next(iter(self.layers.values())).shape[1]

    def __getitem__(self, name: str) -> np.ndarray:
        """The (H, W, C) float32 array of a layer; KeyError with the nearest name where there is none."""
        try:
            return self.layers[name]
        except KeyError:
            raise KeyError(_no_such_layer(name, list(self.layers))) from None

    def __iter__(self):
        return iter(self.layers)

    def __len__(self) -> int:
        return len(self.layers)

    def __contains__(self, name: object) -> bool:
        return name in self.layers

    def __repr__(self) -> str:
        return f"Film({self.width}x{self.height}: {', '.join(self.layers)})"

    def additive_layers(self) -> dict[str, list[str]]:
        """The layers that sum to the beauty, each with the layers of its light groups, where there are several.

        A group's layers sum to their layer.
        """
        table = aov_table()
        names = [row["name"] for row in table if row["is_additive"] and row["name"] in self.layers]
        known = {row["name"] for row in table}
        knots = re.compile(r"translucency_ramp\d+(_.*)?")
        others = [g for g in self.layers if g not in known and not knots.fullmatch(g)]
        return {name: [g for g in others if g.startswith(f"{name}_")] for name in names}

    def save(
        self,
        path: str | os.PathLike,
        compression: str = "zips",
        *,
        layers: Sequence[str] | None = None,
        half_layers: Sequence[str] = (),
        float_layers: Sequence[str] = (),
        multipart: bool = False,
    ) -> None:
        """Write the layers as one multi-channel OpenEXR, whole or not at all.

        Parameters
        ----------
        path : path-like
            The file, in a folder that exists.
        compression : str
            none, rle, zip, zips, piz, pxr24, b44, b44a, dwaa or dwab.
        layers : sequence of str, optional
            Which layers, in this order; all of them if not given.
        half_layers, float_layers : sequence of str
            Layers to store as half or float instead of what the AOV table says. A half layer with values beyond 65504
            is stored as float, with a warning.
        multipart : bool
            Every layer in a part of its own, named after it; else all in one part.

        Raises
        ------
        KeyError
            For a layer that the film does not have; the message has the nearest.
        OSError
            Where the file cannot be written; the old one is then untouched.
        """
        table = {row["name"]: row for row in aov_table()}
        chosen = {name: self[name] for name in (layers if layers is not None else self.layers)}
        halves = {name for name in chosen if not name.startswith("crypto") and table.get(name, {}).get("is_half", True)}
        for name in (*half_layers, *float_layers):
            self[name]  # refuse unknown names
        halves = (halves | set(half_layers)) - set(float_layers)
        promoted = exr.write_exr(
            path,
            chosen,
            {name: _letters(name, array, table) for name, array in chosen.items()},
            half_layers=sorted(halves),
            exact_layers=[name for name in chosen if name.startswith("crypto")],
            compression=compression,
            multipart=multipart,
            metadata=_header(self.metadata),
        )
        for name in promoted:
            message = f"{path}: layer {name} has values beyond half's range (65504); stored as float."
            warnings.warn(message, FrazilWarning, stacklevel=2)

    def save_preview(self, path: str | os.PathLike) -> str:
        """Write the beauty as an 8-bit PNG and return the name of the display transform.

        Where ``OCIO`` names a configuration, its default display and view; else sRGB without tone mapping.
        """
        return image.write_png(path, self["beauty"][:, :, :3])

    @classmethod
    def load(cls, path: str | os.PathLike, *, keep_half: bool = False) -> "Film":
        """Read an EXR that `save` wrote, or any EXR of one or several parts.

        Parameters
        ----------
        path : path-like
            The file.
        keep_half : bool
            Give float16 for layers that are stored as half, at half the memory; else all are float32.

        Raises
        ------
        OSError
            For a file that is missing, truncated or no image.
        """
        layers, metadata = exr.read_exr(path, keep_half=keep_half)
        return cls(layers, metadata)


def _letters(name: str, array: np.ndarray, table: Mapping[str, Mapping[str, Any]]) -> str:
    """The channel letters of a layer: by the AOV table, else by their number."""
    count = array.shape[2]
    letters = table.get(name, {}).get("channels", "")
    return letters if len(letters) == count else {1: "Y", 3: "RGB", 4: "RGBA"}.get(count, "RGBAXYZUVW"[:count])


def _header(metadata: Mapping[str, Any]) -> dict[str, Any]:
    """Metadata as header attributes: what EXR has no type for becomes JSON."""

    def encode(value: Any) -> Any:
        if isinstance(value, Mapping) or (isinstance(value, list | tuple) and any(isinstance(v, str) for v in value)):
            return json.dumps(value, separators=(",", ":"))
        return value

    return {key: encode(value) for key, value in metadata.items() if value is not None}


def _no_such_layer(name: str, known: Sequence[str]) -> str:
    nearest = get_close_matches(str(name), known, n=1)
    hint = f" Did you mean {nearest[0]!r}?" if nearest else ""
    return f"Film: layer must be one of {', '.join(known)}, got {name!r}.{hint}"
