"""The module for 3D Slicer on real VTK data, with stand-ins for Slicer's nodes and widgets; no Slicer was run."""

import importlib
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("vtk", reason="needs VTK: pip install 'isomatch[vtk]'")

import slicer_stub
import vtk
from slicer_stub import MarkupsNode, ModelNode, TransformNode
from vtk.util.numpy_support import vtk_to_numpy

from isomatch import Landmarks, carry_landmarks, write_landmarks, write_mesh
from isomatch.datasets import ground_truth
from isomatch.io import read_mesh
from isomatch.matching import DoubtfulRegion
from isomatch.surfaces import Mesh

FOLDER = Path(__file__).parents[2] / "extras" / "slicer" / "IsomatchModule"
TO_LPS = np.array([-1.0, -1.0, 1.0])


@pytest.fixture(scope="module")
def module():
    """The module, imported as Slicer does."""
    before = dict(sys.modules)
    slicer_stub.installed()
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(FOLDER))
        yield importlib.import_module("IsomatchModule")
    for name in ("IsomatchModule", "slicer", "slicer.ScriptedLoadableModule", "qt", "ctk"):
        sys.modules.pop(name)
        if name in before:
            sys.modules[name] = before[name]


@pytest.fixture
def logic(module):
    return module.IsomatchModuleLogic()


@pytest.fixture
def models(module, example):
    """The shipped pair as nodes, the second one moved in the scene."""
    source, target = (module.polydata_of(made.mesh.vertices, made.mesh.faces) for made in example)
    moved = TransformNode([[0, -1, 0, 10], [1, 0, 0, 20], [0, 0, 1, 30], [0, 0, 0, 1]])
    return ModelNode("standing", source), ModelNode("running", target, moved)


@pytest.fixture(scope="module")
def result(module, example):
    """Their match."""
    pair = [
        ModelNode(n, module.polydata_of(made.mesh.vertices, made.mesh.faces))
        for n, made in zip("ab", example)
    ]
    stages = []
    found = module.IsomatchModuleLogic().match(*pair, progress=lambda stage, share: stages.append(share))
    assert stages == sorted(stages)
    assert stages[-1] == 1
    return found


def array(model, name):
    return vtk_to_numpy(model.GetPolyData().GetPointData().GetArray(name))


def world(transform, positions):
    """Where positions in the coordinates of a model are in the scene."""
    return positions @ transform.matrix[:3, :3].T + transform.matrix[:3, 3]


def positions_of(markups):
    return np.array([[np.nan] * 3 if at is None else at for _, at, _ in markups.points])


def test_surfaces_keep_their_points_and_cut_polygons_and_strips(logic):
    data, points = vtk.vtkPolyData(), vtk.vtkPoints()
    polygons, strips, lines = (vtk.vtkCellArray() for _ in range(3))
    for position in ([0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0], [9, 9, 9]):
        points.InsertNextPoint(position)
    polygons.InsertNextCell(4, [0, 1, 2, 3])
    strips.InsertNextCell(4, [1, 4, 2, 5])
    lines.InsertNextCell(2, [0, 6])
    data.SetPoints(points)
    data.SetPolys(polygons)
    data.SetStrips(strips)
    data.SetLines(lines)
    mesh = logic.surface(ModelNode("strip", data))
    assert mesh.n_vertices == 7
    assert mesh.n_faces == 4
    assert mesh.area == pytest.approx(2)
    np.testing.assert_allclose(mesh.vertex_normals[:6] @ [0, 0, 1], 1)


def test_a_model_without_surface_is_refused(module, logic):
    with pytest.raises(module.Refused, match="empty has no surface"):
        logic.surface(ModelNode("empty", vtk.vtkPolyData()))
    with pytest.raises(module.Refused, match="volume has no surface"):
        logic.surface(ModelNode("volume"))


def test_colours_correspond_and_are_shown_as_they_are(module, logic, models, result, example_truth):
    logic.show_map(result, *models)
    source, target = (array(model, module.COLOURS).astype(float) for model in models)
    assert source.shape[1] == 3
    away = np.abs(source - target[example_truth]).mean()
    assert away < 0.1 * np.abs(source - np.roll(source, 1000, axis=0)).mean()
    for model in models:
        node = model.GetDisplayNode()
        node.SetActiveScalar.assert_called_with(module.COLOURS, vtk.vtkAssignAttribute.POINT_DATA)
        node.SetScalarRangeFlag.assert_called_with(4)


def test_error_and_doubt_are_scalars_of_the_source(module, logic, models, result):
    logic.show_error(result, *models)
    area = logic.surface(models[1]).area
    np.testing.assert_allclose(array(models[0], module.ERROR), result.expected_error * np.sqrt(area))
    assert logic.show_doubt(result, *models) == []
    assert not array(models[0], module.DOUBT).any()
    doubtful = replace(result, regions=(DoubtfulRegion(np.array([5, 6]), 0.01, "it looks unlike its image"),))
    assert logic.show_doubt(doubtful, *models) == [
        "1: 1.0% of the area around vertex 5: it looks unlike its image"
    ]
    np.testing.assert_array_equal(np.flatnonzero(array(models[0], module.DOUBT)), [5, 6])


@pytest.mark.long
@pytest.mark.parametrize("to", ["target", "source"])
def test_landmarks_go_from_world_to_world(logic, models, result, example, to):
    give, get = (0, 1) if to == "target" else (1, 0)
    chosen = [0, 500, 1200]
    given, moved = example[give].mesh.vertices[chosen], models[1].transform
    marks = MarkupsNode("marks", points=[(f"m{i}", at) for i, at in enumerate(given.tolist())])
    if give == 1:
        for point, at in zip(marks.points, world(moved, given).tolist()):
            point[1] = at
    marks.points.append(["not placed", None, ""])
    carried = logic.carry(result, *models, marks, to)
    assert [label for label, _, _ in carried.points] == ["m0", "m1", "m2", "not placed"]
    assert carried.name == f"marks on {models[get].name}"
    assert carried.points[3][1] is None
    assert carried.points[0][2].startswith("expected error")
    truth = ground_truth(example[give], example[get]).points(example[get].mesh)[chosen]
    expected = world(moved, truth) if get == 1 else truth
    away = np.linalg.norm(positions_of(carried)[:3] - expected, axis=1)
    assert away.max() < 0.05 * np.sqrt(example[get].mesh.area)


def test_memory_in_ras_and_files_in_lps_agree(logic, models, result, example, tmp_path):
    """Slicer writes models and markups in LPS; isomatch carries the files to where the module carries the nodes."""
    meshes = []
    for made, name in zip(example, ("source.ply", "target.ply")):
        write_mesh(tmp_path / name, Mesh(made.mesh.vertices * TO_LPS, made.mesh.faces))
        meshes.append(read_mesh(tmp_path / name))
    given = example[0].mesh.vertices[[3, 700]]
    write_landmarks(tmp_path / "marks.mrk.json", Landmarks(given * TO_LPS, ["a", "b"]))
    marks = Landmarks.read(tmp_path / "marks.mrk.json", meshes[0])
    same = type(result.map)(
        result.map.vertices, result.map.n_target, result.map.faces, result.map.barycentric
    )
    in_files = carry_landmarks(same, *meshes, marks).positions
    target = ModelNode("running", models[1].data)
    node = MarkupsNode("marks", points=list(zip("ab", given.tolist())))
    in_memory = positions_of(logic.carry(result, models[0], target, node))
    np.testing.assert_allclose(in_memory, in_files * TO_LPS, atol=1e-5)


@pytest.mark.long
def test_curves_stay_curves(logic, models, result, example):
    mesh = example[0].mesh
    a = int(mesh.vertices[:, 1].argmax())
    ring = np.argsort(np.linalg.norm(mesh.vertices - mesh.vertices[a], axis=1))[[0, 40, 90]]
    points = [(f"c{i}", mesh.vertices[v].tolist()) for i, v in enumerate(ring)]
    curve = MarkupsNode("rim", "vtkMRMLMarkupsCurveNode", points)
    carried = logic.carry(result, *models, curve)
    assert carried.kind == "vtkMRMLMarkupsCurveNode"
    assert len(carried.points) == 3
    assert np.isfinite(positions_of(carried)).all()


def test_landmarks_are_priors_by_label_or_in_order(module):
    first = Landmarks([[0, 0, 0], [1, 0, 0], [np.nan] * 3], ["a", "b", "c"])
    second = Landmarks([[0, 0, 0], [1, 0, 0], [2, 0, 0]], ["b", "a", "c"])
    assert module.joined(first, second) == [(0, 1), (1, 0)]
    others = Landmarks([[0, 0, 0], [1, 0, 0]], ["F-1", "F-2"])
    assert module.joined(first, others) == [(0, 0), (1, 1)]
    with pytest.raises(module.Refused, match="landmarks"):
        module.joined(others, second)


def test_what_does_not_fit_is_refused_in_words(module, logic, models, result):
    far = MarkupsNode("far", points=[("x", [1000.0, 0, 0])])
    with pytest.raises(module.Refused, match="away from standing"):
        logic.carry(result, *models, far)
    with pytest.raises(module.Refused, match="no placed points"):
        logic.carry(result, *models, MarkupsNode("none"))
    with pytest.raises(module.Refused, match="running"):
        logic.show_map(result, *models[::-1])
    with pytest.raises(module.Refused, match="same model"):
        logic.planned(models[0], models[0])
    few = MarkupsNode("few", points=[("a", [0, 0, 0]), ("b", [0, 0, 0])])
    with pytest.raises(module.Refused, match="2 pairs"):
        logic.planned(*models, few, few)
    for marks in ((few, None), (None, few)):
        with pytest.raises(module.Refused, match="on one model only"):
            logic.planned(*models, *marks)


@pytest.mark.long
def test_a_cohort_is_matched_and_its_landmarks_are_carried(logic, module, example, tmp_path):
    shapes = tmp_path / "shapes"
    shapes.mkdir()
    for made, name in zip(example, "ab"):
        write_mesh(shapes / f"{name}.ply", Mesh(made.mesh.vertices * TO_LPS, made.mesh.faces))
    marked = Landmarks(example[0].mesh.vertices[[0, 500]], ["tip", "back"])  # in RAS, as in memory
    done = []
    found = logic.cohort(shapes, tmp_path / "out", "a", marked, lambda what, share: done.append(share))
    assert (found["shapes"], found["pairs"], found["failed"], found["landmarks"]) == (2, 1, {}, ["a", "b"])
    assert (tmp_path / "out" / "index.html").exists()
    truth = ground_truth(*example).points(example[1].mesh)[[0, 500]]
    carried = Landmarks.read(tmp_path / "out" / "landmarks" / "b.mrk.json").positions * TO_LPS
    assert np.linalg.norm(carried - truth, axis=1).max() < 0.05 * np.sqrt(example[1].mesh.area)
    with pytest.raises(module.Refused, match="those of a template"):
        logic.cohort(shapes, tmp_path / "other", None, marked)


def test_slicer_goes_on_during_a_job_and_can_give_it_up(module):
    def work(tell):
        for step in range(300):
            tell("counting", step / 300)
            time.sleep(0.001)
        return "done"

    seen = []
    assert module.Job(work).result(lambda what, share: seen.append((what, share))) == "done"
    assert len(seen) > 2
    assert seen[-1][0] == "counting"
    job = module.Job(work)
    with pytest.raises(module.Cancelled):
        job.result(lambda what, share: job.cancel())
    with pytest.raises(ZeroDivisionError):
        module.Job(lambda tell: 1 / 0).result(lambda what, share: None)


def test_the_panel_matches_and_carries(module, models, result):
    """The widgets are mocks: this finds what is wired to nothing, not what Qt would refuse."""
    import slicer

    widget = module.IsomatchModuleWidget()
    widget.setup()
    for box, node in (
        (widget.source, models[0]),
        (widget.target, models[1]),
        (widget.source_marks, None),
        (widget.target_marks, None),
        (widget.carried, MarkupsNode("tip", points=[("tip", models[0].data.GetPoint(0))])),
    ):
        box.currentNode.return_value = node
    widget.either.checked = False
    widget.logic.planned = lambda *_: lambda tell: result
    with module.told():
        widget.on_match()
        widget.on_carry("target")
    slicer.util.errorDisplay.assert_not_called()
    assert widget.result is result
    widget.said.setText.assert_called_with(f"{result.outcome.value}: {result.outcome.advice}")
    for way in (widget.logic.show_map, widget.logic.show_error, widget.logic.show_doubt):
        widget.show(way)
    widget.said.setText.assert_called_with("no region is doubtful")
    widget.result = None
    with module.told():
        widget.on_carry("target")
    slicer.util.errorDisplay.assert_called_with("there is no map yet; match first")


def test_its_own_test_passes(module, monkeypatch, result):
    """The test that Slicer runs, with a match that is known."""
    monkeypatch.setattr(module.IsomatchModuleLogic, "match", lambda *given: result)
    module.IsomatchModuleTest().runTest()
