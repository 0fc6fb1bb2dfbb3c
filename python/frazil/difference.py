"""How different two pictures look when one takes the place of the other.

Model: LDR-FLIP [Andersson2020] by its authors' package, 67 pixels per degree, over the sRGB display of both pictures.
Units: 0 = the same, 1 = as different as black and white.
Not: HDR-FLIP: light beyond white counts as white.
"""

import numpy as np

from .image import display_rgb

__all__ = ["flip_difference"]


def flip_difference(reference: np.ndarray, picture: np.ndarray, weights: np.ndarray | None = None) -> float:
    """Mean FLIP of two linear pictures (H, W, 3), weighted by (H, W) `weights`."""
    import flip_evaluator

    shown = [np.ascontiguousarray(display_rgb(np.asarray(p, np.float32))[0]) for p in (reference, picture)]
    # The package takes display values as sRGB unless told otherwise, and gives a map of one channel.
    error, _, _ = flip_evaluator.evaluate(*shown, "LDR", inputsRGB=True, applyMagma=False)
    error = np.asarray(error, np.float64).reshape(reference.shape[0], reference.shape[1], -1)[:, :, 0]
    return float(np.average(error, weights=weights))
