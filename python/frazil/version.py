"""The version of the installed package, said once in pyproject.toml."""

from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as installed_version

__all__ = ["version"]


def version() -> str:
    """``major.minor.patch``; "unknown" where the package runs from a source tree that was never installed."""
    try:
        return installed_version("frazil")
    except PackageNotFoundError:
        return "unknown"
