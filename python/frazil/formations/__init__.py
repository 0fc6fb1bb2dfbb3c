"""Procedural ice to start from."""

from .cathedral import cathedral
from .formation import Formation
from .spires import ice_tips, spire_cluster
from .usd import write_formation

FORMATIONS = {"spire_cluster": spire_cluster, "ice_tips": ice_tips, "cathedral": cathedral}
