"""Our EXRs under the tools of the OpenEXR project (Debian: openexr), where they are installed."""

import shutil
import subprocess

import pytest
from small_scenes import ice_over_floor

import frazil as fz


@pytest.fixture(scope="module")
def film():
    return fz.render(
        ice_over_floor(), resolution=(40, 24), samples=2, bake_samples=2, spacing=0.2, aovs=["crypto_object", "motion"]
    )


@pytest.mark.parametrize("multipart", [False, True])
@pytest.mark.parametrize("compression", ["zips", "piz", "dwaa", "none"])
def test_exrheader_and_exrinfo_read_what_was_written(tmp_path, film, multipart, compression):
    header, info = shutil.which("exrheader"), shutil.which("exrinfo")
    if header is None or info is None:
        pytest.skip("exrheader and exrinfo are not installed: apt-get install openexr")
    if compression == "dwaa" and not multipart:
        pytest.skip("refused: Cryptomatte must not be compressed with loss")
    path = tmp_path / "a.exr"
    film.save(path, compression, multipart=multipart)
    said = subprocess.run([header, str(path)], capture_output=True, text=True, check=True).stdout
    assert "translucency.R, 16-bit floating-point" in said or multipart
    assert "frazil:light_groups" in said
    strict = subprocess.run([info, "-s", "-a", str(path)], capture_output=True, text=True)
    assert strict.returncode == 0, strict.stderr
