"""Checkpoints: a render that was stopped goes on to the very same picture.

Model: the core gives its state as arrays, now and then and when it is stopped; the file also holds a content hash of
the scene and the options, so that no other render takes it up. An uncompressed npz, replaced whole.
Valid: for the same version of Frazil.
Not: bakes, which are made anew or come from their cache.
"""

import os
from pathlib import Path
from typing import Any

import numpy as np

from .content import content_hash, scene_hash
from .replacing import DAMAGED_ARCHIVE, replacing

__all__ = ["Checkpoint"]


class Checkpoint:
    """The file of one render.

    Parameters
    ----------
    path : path-like
        The file.
    scene : Scene
    options : dict
        Of the render; `threads` is left out, as the picture does not depend on it.
    """

    def __init__(self, path: str | os.PathLike, scene: Any, options: dict[str, Any]):
        self.path = Path(path)
        chosen = {name: value for name, value in options.items() if name != "threads"}
        self._key = content_hash(scene_hash(scene), scene.lights, scene.camera, scene.motion, chosen)

    def save(self, state: dict[str, np.ndarray]) -> None:
        """Write the state, whole or not at all."""
        with replacing(self.path) as temporary, temporary.open("wb") as stream:
            np.savez(stream, key=np.array(self._key), **state)

    def load(self) -> dict[str, np.ndarray]:
        """The state.

        Raises
        ------
        ValueError
            For a checkpoint of another scene or other options.
        OSError
            For a file that is missing, damaged or no checkpoint.
        """
        if not self.path.exists():
            raise FileNotFoundError(f"{self.path}: checkpoint must exist. Render without resuming.")
        try:
            with np.load(self.path, allow_pickle=False) as archive:
                state = {name: archive[name] for name in archive.files}
                key = str(state.pop("key"))
        except DAMAGED_ARCHIVE as error:
            message = f"{self.path}: checkpoint must be a whole file of Frazil's, got another ({error})."
            raise OSError(f"{message} Delete it and render without resuming.") from error
        if key != self._key:
            raise ValueError(
                f"{self.path}: checkpoint must be of this scene and these options, got one of others. "
                "Delete it, or give the options that it was made with."
            )
        return state
