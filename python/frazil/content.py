"""What a scene is made of, as one short text: equal texts mean equal content.

Model: BLAKE2b over every public property of every part, walked by name, so that a property that is added to a material
or a light counts from its first day.
Valid: across runs and machines of one version of Frazil.
Not: paths of files; a file that was written anew with the same content counts as unchanged.
"""

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .version import version

__all__ = ["content_hash", "scene_hash"]


def content_hash(*values: Any) -> str:
    """A text of 32 hexadecimal digits for any nesting of numbers, texts, arrays and objects of the core.

    Raises
    ------
    TypeError
        For a value that has no public properties and is no number, text, array or container.
    """
    digest = hashlib.blake2b(digest_size=16)
    _feed(digest, values)
    return digest.hexdigest()


def scene_hash(scene: Any, leaving_out: Sequence[str] = ()) -> str:
    """The content of what light meets: meshes, materials, placements; neither lights nor camera.

    Properties of materials whose names begin as `leaving_out` says do not count.
    """
    meshes = [content_hash(scene.mesh(i)) for i in range(len(scene.mesh_paths))]
    digest = hashlib.blake2b(digest_size=16)
    _feed(digest, (version(), meshes, scene.objects))
    _feed(digest, scene.materials, tuple(leaving_out))
    return digest.hexdigest()


def _feed(digest: Any, value: Any, leaving_out: tuple[str, ...] = ()) -> None:
    if value is None or isinstance(value, bool | int | float | str | bytes | np.generic):
        digest.update(f"{type(value).__name__}:{value!r};".encode())
    elif isinstance(value, np.ndarray):
        digest.update(f"{value.dtype}{value.shape};".encode())
        digest.update(np.ascontiguousarray(value).data)
    elif isinstance(value, Mapping):
        for key in sorted(value):
            _feed(digest, (key, value[key]), leaving_out)
    elif isinstance(value, list | tuple | set | frozenset):
        digest.update(f"{len(value)}[".encode())
        for item in sorted(value) if isinstance(value, set | frozenset) else value:
            _feed(digest, item, leaving_out)
    else:
        names = _properties(type(value))
        if not names:
            raise TypeError(f"content_hash: value must have public properties, got {type(value).__name__}.")
        digest.update(f"{type(value).__name__}(".encode())
        for name in names:
            if name.startswith(leaving_out):
                continue
            digest.update(f"{name}=".encode())
            _feed(digest, getattr(value, name), leaving_out)


def _properties(kind: type) -> list[str]:
    return [name for name in dir(kind) if not name.startswith("_") and not callable(getattr(kind, name))]
