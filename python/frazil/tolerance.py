"""The relative error that clustering may make in the gathers of renders and bakes, where none is named.

It is coarser than `PointTree.gather`'s own default: its error is far below the noise of pixels, and the glacier of
examples/ takes 1.13 times the processor time at 0.003 (320 x 180, 8 samples).
"""

__all__ = ["RENDER_TOLERANCE"]

RENDER_TOLERANCE = 0.01
