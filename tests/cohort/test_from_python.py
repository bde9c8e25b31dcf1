"""What the commands do, called from Python: steps and warnings go to functions of the caller."""

import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from corresponded import ellipsoids
from isomatch import InputError, cohort, write_mesh
from isomatch.cli import main
from small_collections import arrays_of

pytestmark = pytest.mark.usefixtures("coarse_pictures")


class Told(list):
    """Steps with their shares, and warnings."""

    def progress(self, step, share):
        assert 0 <= share <= 1
        self.append(step)


@pytest.mark.long
def test_a_run_is_that_of_the_command(small, tmp_path, in_threads, capsys):
    told, warned = Told(), []
    with ThreadPoolExecutor(1) as executor:
        how = {"template": "s0", "config": small.config, "reports": "none", "executor": executor, "jobs": 1}
        found = cohort.run(tmp_path / "a", small.shapes, **how, progress=told.progress, warn=warned.append)
    argv = ["collect", str(small.shapes), "-o", str(tmp_path / "b"), "--template", "s0", "--reports", "none"]
    assert main([*argv, "--jobs", "1", "--config", str(small.settings), "--json"]) == 0
    plain = json.loads(capsys.readouterr().out)
    assert json.loads(json.dumps(found.to_json(found.status()))) == {**plain, "folder": str(tmp_path / "a")}
    assert arrays_of(tmp_path / "a") == arrays_of(tmp_path / "b")
    assert [step for step in told if step.startswith("matched")] == [
        f"matched {i} of 3: s0 and s{i}, converged" for i in (1, 2, 3)
    ]
    assert warned == []
    (again,) = cohort.Cohort.open(tmp_path / "a").status().values()
    assert again == found.status()[""]


@pytest.fixture
def shapes(tmp_path):
    """A folder of four shapes in one topology."""
    (tmp_path / "shapes").mkdir()
    made = ellipsoids([0.8, 0.9, 1.0, 1.2])
    for i, name in enumerate(made.names):
        write_mesh(tmp_path / "shapes" / f"{name}.ply", made.mesh(i))
    return tmp_path / "shapes"


@pytest.mark.long
def test_statistics_give_the_model_and_what_was_written(shapes, tmp_path):
    told, out = Told(), tmp_path / "out"
    found = cohort.statistics(shapes, out, modes=1, progress=told.progress)
    assert found.model.names == ("e00", "e01", "e02", "e03")
    assert json.loads((out / "statistics.json").read_text())["shares"] == found.record["shares"]
    here = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}
    assert {*found.files, "statistics.json"} == here
    assert (told[0], told[-1]) == ("reading", "done")
    scored = cohort.project(out / "model.npz", [shapes / "e00.ply"], tmp_path / "scored")
    (line,) = scored.record["shapes"]
    np.testing.assert_allclose(line["scores"], found.model.scores[0], atol=1e-5)


def test_what_is_wrong_is_an_error_of_the_library(shapes, tmp_path):
    with pytest.raises(InputError, match="no such shape"):
        cohort.series(shapes, tmp_path / "out", reference="e09")
    cohort.Collection.create(tmp_path / "all", shapes)
    with pytest.raises(InputError, match="no model"):
        cohort.add(tmp_path / "all", [shapes / "e00.ply"])
