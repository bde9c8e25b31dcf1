"""Every example of the gallery runs, and draws what the gallery shows."""

import runpy
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

pytestmark = pytest.mark.usefixtures("prepared_once")
EXAMPLES = sorted(Path(__file__).parents[1].glob("examples/*/*.py"))
WITHOUT_PICTURES = ("prepare_once", "save_and_load")


@pytest.mark.long
@pytest.mark.parametrize("example", EXAMPLES, ids=[path.stem for path in EXAMPLES])
def test_an_example_runs(example, tmp_path, monkeypatch):
    if example.stem.startswith("blender"):
        pytest.skip("runs in Blender")
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(example), run_name="__main__")
    drawn = [*tmp_path.glob("*.png"), *tmp_path.glob("*.html"), *plt.get_fignums()]
    plt.close("all")
    assert drawn or example.stem in WITHOUT_PICTURES
