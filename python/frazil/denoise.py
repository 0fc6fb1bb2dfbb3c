"""`denoise_film`: Open Image Denoise on the ray-traced layers, each by itself, so that they still sum to the beauty.

Model: translucency comes from points and has no noise, so it stays as it is; so do emission and background. Every other
additive layer is denoised apart, per light group where there are groups, guided by albedo and normal; layers and beauty
are summed anew.
Valid: where negative lights make a layer negative, its positive and its negative part are denoised apart.
Not: animation; every frame is on its own.
"""

from typing import Any

import numpy as np

from .film import Film

__all__ = ["check_denoiser", "denoise_film"]

NOISELESS = ("translucency", "emission", "background")


def check_denoiser() -> Any:
    """The denoiser's module; RuntimeError with the remedy where it is not installed."""
    try:
        import pyoidn
    except (ImportError, OSError) as error:
        raise RuntimeError(
            f"denoise: Open Image Denoise must be installed, got {error}. Run: pip install frazil[denoise]"
        ) from error
    return pyoidn


def denoise_film(film: Film) -> None:
    """Denoise a film's ray-traced layers in place.

    Parameters
    ----------
    film : Film
        With the layers ``albedo`` and ``N`` and all additive layers, as `render` gives it.

    Raises
    ------
    RuntimeError
        Where Open Image Denoise is not installed.
    """
    oidn = check_denoiser()
    guides = {"albedo": _guide(film["albedo"], 0.0), "normal": _guide(film["N"], -1.0)}

    def clean(layer: np.ndarray) -> np.ndarray:
        result = np.zeros_like(layer)
        for sign in (1.0, -1.0):
            part = np.maximum(sign * layer, 0.0)
            if part.any():
                result += sign * oidn.denoise(part, **guides, hdr=True)
        return result

    additive = film.additive_layers()
    for name, groups in additive.items():
        if name in NOISELESS or not film[name].any():
            continue
        for group in groups:
            film[group][:] = clean(film[group])
        film[name][:] = sum(film[group] for group in groups) if groups else clean(film[name])
    beauty = sum(film[name] for name in additive)
    film["beauty"][:, :, :3] = beauty


def _guide(layer: np.ndarray, low: float) -> np.ndarray:
    return np.ascontiguousarray(np.clip(layer, low, 1.0), dtype=np.float32)
