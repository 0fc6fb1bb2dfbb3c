"""Renders that are stopped: nothing lost but the last interval, the same bits in the end."""

import os
import signal
import subprocess
import sys
import textwrap
import time

import numpy as np
import pytest
from small_scenes import ice_over_floor

import frazil as fz

OPTIONS = {"spacing": 0.2, "bake_samples": 4, "resolution": (48, 32), "samples": 96}


class Stop(Exception):
    pass


def stop_at(fraction):
    def report(stage, done):
        if stage == "render" and done >= fraction:
            raise Stop

    return report


@pytest.mark.parametrize("noise", [0.0, 0.002])
def test_a_stopped_render_goes_on_to_the_same_bits(tmp_path, noise):
    whole = fz.render(ice_over_floor(), noise=noise, **OPTIONS)
    path = tmp_path / "a.checkpoint"
    for fraction in (0.2, 0.5):
        with pytest.raises(Stop):
            fz.render(
                ice_over_floor(),
                noise=noise,
                checkpoint=path,
                resume=path.exists(),
                progress=stop_at(fraction),
                **OPTIONS,
            )
        assert path.exists()
    resumed = fz.render(ice_over_floor(), noise=noise, checkpoint=path, resume=True, threads=1, **OPTIONS)
    for name in whole:
        np.testing.assert_array_equal(resumed[name], whole[name], err_msg=name)


def test_a_checkpoint_of_another_scene_or_of_other_options_is_refused(tmp_path):
    path = tmp_path / "a.checkpoint"
    with pytest.raises(Stop):
        fz.render(ice_over_floor(), checkpoint=path, progress=stop_at(0.3), **OPTIONS)
    job = {"checkpoint": path, "resume": True}
    with pytest.raises(ValueError, match="a.checkpoint: checkpoint must be of this scene"):
        fz.render(ice_over_floor(key=1.0), **job, **OPTIONS)
    with pytest.raises(ValueError, match="a.checkpoint: checkpoint must be of this scene"):
        fz.render(ice_over_floor(), seed=1, **job, **OPTIONS)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(OSError, match="a.checkpoint: checkpoint must be a whole file"):
        fz.render(ice_over_floor(), **job, **OPTIONS)
    with pytest.raises(FileNotFoundError, match="checkpoint must exist"):
        fz.render(ice_over_floor(), checkpoint=tmp_path / "b", resume=True, **OPTIONS)
    with pytest.raises(ValueError, match="resume must come with a checkpoint"):
        fz.render(ice_over_floor(), resume=True, **OPTIONS)


WORKER = """
    import sys
    sys.path.insert(0, {here!r})
    from small_scenes import ice_over_floor
    import frazil as fz
    from pathlib import Path
    path = Path({path!r})
    job = dict(checkpoint=path, checkpoint_minutes=0.2 / 60, resume=path.exists())
    film = fz.render(ice_over_floor(), **job, **{options!r})
    film.save({exr!r})
"""


def test_kill_in_a_loop_loses_no_more_than_the_last_interval(tmp_path):
    options = {**OPTIONS, "samples": 1000}
    path, exr = tmp_path / "a.checkpoint", tmp_path / "a.exr"
    here = os.path.dirname(__file__)
    code = textwrap.dedent(WORKER.format(here=here, path=str(path), exr=str(exr), options=options))
    for kill in range(5):
        worker = subprocess.Popen([sys.executable, "-c", code])
        before = path.stat().st_mtime_ns if path.exists() else 0
        while worker.poll() is None and (not path.exists() or path.stat().st_mtime_ns == before):
            time.sleep(0.01)
        time.sleep(0.05 * kill)  # at another moment of the interval each time
        worker.send_signal(signal.SIGKILL)
        worker.wait()
        assert not exr.exists(), "the render was over before it was killed: give it more samples"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=300)
    whole = fz.render(ice_over_floor(), **options)
    resumed = fz.Film.load(exr)
    np.testing.assert_array_equal(resumed["Z"], whole["Z"])
    np.testing.assert_array_equal(resumed["variance"], whole["variance"])
    np.testing.assert_allclose(resumed["beauty"], whole["beauty"], rtol=1e-3, atol=1e-4)
