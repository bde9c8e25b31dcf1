"""Shapes in the signatures of `isomatch.matching` hold at every call; what mypy refuses is in `index_spaces.py`."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from jaxtyping import TypeCheckError, jaxtyped
from test_components import Dressed
from test_elastic import other_species

from checked_shapes import checked
from isomatch import Config, PointCloud, match, match_both, prepare
from isomatch.datasets import example_pair, ground_truth
from isomatch.matching import Elastic, TwoParts
from isomatch.matching.isometric.candidates import energy_of
from isomatch.matching.verify import largest_piece
from isomatch.settings import PartSettings
from isomatch_lab.damage import cut
from isomatch_lab.procedural import creature
from isomatch_lab.sets import relabelled
from shapes import icosphere

HERE = Path(__file__).parent
FEW = Config(parts=PartSettings(n_common=2))


@pytest.mark.parametrize("inside", [np.ones((162, 1), dtype=bool), np.ones(162), [True] * 162])
def test_a_wrong_shape_or_type_is_refused(inside):
    pieces = jaxtyped(typechecker=checked)(largest_piece)
    assert pieces(icosphere(2), np.ones(162, dtype=bool)).shape == (162,)
    with pytest.raises(TypeCheckError, match="inside"):
        pieces(icosphere(2), inside)


def test_lengths_of_one_letter_are_equal():
    with pytest.raises(TypeCheckError, match="target_vertex"):
        jaxtyped(typechecker=checked)(energy_of)(None, np.arange(3), np.arange(4))


def complete():
    match(*(animal.mesh for animal in example_pair()))


def creatures():
    """Two poses of an animal, and the true image of each vertex."""
    first, second = (creature(1500, triangulation=i, pose=i) for i in (1, 2))
    target, new = relabelled(second.mesh, 0)
    return first.mesh, target, new[ground_truth(first, second).vertices]


def priors():
    source, target, truth = creatures()
    rows = prepare(source).column_vertices[:5]
    landmarks = np.column_stack([rows, truth[rows]])
    heights = source.vertices[:, 2], target.vertices[:, 2]
    match(source, target, landmarks, truth, functions=heights, config=Config(pin=0.0))
    match(source, target, initial_descriptors=(source.vertices, target.vertices))
    match(source, target, config=Config(start="pose", refinement="laplace_icp"))


def part():
    source, target, _ = creatures()
    match_both(cut(source, 0.3, seed=4).mesh, target)


def two_parts():
    source, target, truth = creatures()
    part, other = cut(source, 0.4, seed=0), cut(target, 0.4, seed=2)
    image = other.damaged_vertex[truth[part.original]]
    match(part.mesh, other.mesh, config=FEW, relation=TwoParts)
    match(part.mesh, other.mesh, initial_map=image, config=FEW, relation=TwoParts)


def stretched():
    first, second = (creature(1500, triangulation=i, symmetric=True) for i in (1, 2))
    truth = ground_truth(first, second).vertices
    match(first.mesh, other_species(second))
    match(first.mesh, other_species(second), initial_map=truth, relation=Elastic)


def components():
    match(*(Dressed.of(creature(1500, triangulation=i, pose=i), "left", "hat", seed=i).mesh for i in (1, 2)))


def clouds():
    match(*(PointCloud(creature(1500, pose=i).mesh.vertices) for i in (1, 2)))


@pytest.mark.long
@pytest.mark.parametrize("case", [complete, priors, part, two_parts, stretched, components, clouds])
def test_every_shape_holds_in_a_match(case):
    script = "from checked_shapes import shapes_checked\n"
    script += f"with shapes_checked():\n  import test_array_shapes\n  test_array_shapes.{case.__name__}()"
    paths = os.pathsep.join([str(HERE), str(HERE.parent), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=False
    )
    assert not done.returncode, done.stderr
