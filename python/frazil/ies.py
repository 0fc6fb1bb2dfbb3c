"""Luminaires' profiles from IES files (LM-63, 1986 to 2019).

Units: degrees and candela, the file's multiplier and ballast factors applied.
Not: photometric types A and B, lamps' tilt factors (named in the error, or left out).
"""

from __future__ import annotations

from pathlib import Path

from ._frazil import IesProfile

__all__ = ["read_ies"]

_TYPE_C = 1
_MOST_BYTES = 64 << 20  # files are a few kilobytes; a larger one is something else


def read_ies(path: str | Path) -> IesProfile:
    """The profile of an IES file.

    Parameters
    ----------
    path : str or Path
        A file by IES LM-63, photometric type C.

    Returns
    -------
    IesProfile

    Raises
    ------
    OSError
        For a file that cannot be read.
    ValueError
        For a file that is no IES file, is cut short, or of photometric type A or B.

    Examples
    --------
    >>> profile = read_ies("downlight.ies")  # doctest: +SKIP
    >>> profile.intensity((0, 0, -1))  # candela straight down  # doctest: +SKIP
    """
    path = Path(path)
    if path.stat().st_size > _MOST_BYTES:
        raise ValueError(f"{path}: must be an IES file, got {path.stat().st_size} bytes.")
    lines = path.read_text(encoding="latin-1").splitlines()
    tilt = next((i for i, line in enumerate(lines) if line.strip().upper().startswith("TILT")), None)
    if tilt is None:
        raise ValueError(f"{path}: must be an IES file, got one without a TILT line.")
    numbers = _Numbers(path, lines[tilt + 1 :])
    if lines[tilt].partition("=")[2].strip().upper() == "INCLUDE":
        numbers.take(1, "the lamp's geometry")
        numbers.take(2 * numbers.count("the number of tilt angles"), "tilt angles and factors")
    _, _, multiplier = numbers.take(3, "lamps, lumens and multiplier")
    vertical_count = numbers.count("the number of vertical angles")
    horizontal_count = numbers.count("the number of horizontal angles")
    photometric_type, _, _, _, _ = numbers.take(5, "type, units and size")
    ballast, lamp_factor, _ = numbers.take(3, "ballast factors and watts")
    if photometric_type != _TYPE_C:
        raise ValueError(
            f"{path}: photometric type must be 1 (C), got {photometric_type:g}. Convert the profile to type C."
        )
    vertical = numbers.take(vertical_count, "vertical angles")
    horizontal = numbers.take(horizontal_count, "horizontal angles")
    scale = multiplier * ballast * lamp_factor
    rows = [[scale * x for x in numbers.take(vertical_count, "intensities")] for _ in range(horizontal_count)]
    return IesProfile(vertical, horizontal, rows, str(path))


class _Numbers:
    """The numbers of a file, one after the other, over lines and commas."""

    def __init__(self, path: Path, lines: list[str]) -> None:
        self._path = path
        self._words = iter(" ".join(lines).replace(",", " ").split())

    def take(self, count: int, what: str) -> list[float]:
        result = []
        for _ in range(count):
            word = next(self._words, None)
            if word is None:
                raise ValueError(f"{self._path}: must hold {what}, got the end of the file.")
            try:
                result.append(float(word))
            except ValueError:
                raise ValueError(f"{self._path}: {what} must be numbers, got '{word[:40]}'.") from None
        return result

    def count(self, what: str) -> int:
        (value,) = self.take(1, what)
        if not 1 <= value <= 1e5 or value != int(value):
            raise ValueError(f"{self._path}: {what} must be in 1..100000, got {value:g}.")
        return int(value)
