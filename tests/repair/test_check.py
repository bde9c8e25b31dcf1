"""Every defect is found where it is, nothing else is, and each has a sentence that says what to do."""

import json

import numpy as np
import pytest
from hypothesis import given, settings

from isomatch.repair import check
from isomatch.surfaces import Mesh
from shapes import inside_out
from zoo import any_mesh, grid, mobius, specimen, torus, zoo
from zoo.made import together

DEFECTS = {
    "non_finite_vertex": "non_finite_vertices",
    "out_of_range_face": "out_of_range_faces",
    "repeated_index_face": "repeated_index_faces",
    "duplicate_face": "duplicate_faces",
    "zero_area_face": "zero_area_faces",
    "sliver_face": "sliver_faces",
    "unused_vertex": "unused_vertices",
    "coincident_vertex": "coincident_vertices",
    "non_manifold_edge": "non_manifold_edges",
    "non_manifold_vertex": "non_manifold_vertices",
    "inconsistent_edge": "inconsistent_edges",
    "inward_component": "inward_components",
}


@pytest.mark.long
@given(any_mesh())
@settings(max_examples=200, deadline=None)
def test_any_array_content_gets_a_report(mesh):
    report = check(mesh)
    assert json.loads(json.dumps(report.to_dict()))["n_faces"] == mesh.n_faces
    assert str(report)


@pytest.mark.parametrize("specimen", zoo(), ids=repr)
def test_exactly_the_tagged_defects_are_reported(specimen):
    report = check(specimen.mesh)
    assert {
        tag for tag, field in DEFECTS.items() if len(getattr(report, field))
    } == specimen.tags & DEFECTS.keys()
    assert bool(report.fatal) == ("fatal" in specimen.tags)
    assert report.ok == bool({"sound", "extreme"} & specimen.tags)
    assert (report.n_components == 2) == ("two_components" in specimen.tags)
    assert (report.n_boundary_loops > 0) == ("boundary" in specimen.tags)
    assert report.euler_number == specimen.euler


@pytest.mark.parametrize("specimen", [s for s in zoo() if "out_of_range_face" not in s.tags], ids=repr)
def test_relabelling_changes_no_count(specimen):
    mesh, rng = specimen.mesh, np.random.default_rng(1)
    order, name = rng.permutation(mesh.n_faces), rng.permutation(mesh.n_vertices)
    vertices = np.zeros_like(mesh.vertices)
    vertices[name] = mesh.vertices
    a, b = check(mesh), check(Mesh(vertices, np.roll(name[mesh.faces][order], 1, axis=1)))
    for field in DEFECTS.values():
        assert len(getattr(a, field)) == len(getattr(b, field)), field
    np.testing.assert_allclose(a.boundary_lengths, b.boundary_lengths)
    np.testing.assert_allclose(a.component_shares, b.component_shares)


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("nan", "vertices with NaN or infinite coordinates (number 0): no distance is defined there; repair"),
        (
            "wild",
            "faces with a vertex index out of range (numbers 12, 13): the surface is undefined there; repair(mesh)",
        ),
        ("no_faces", "no faces, so there is no surface to measure distances on; give a mesh with faces"),
        ("point", "no sound face of positive area, so there is no surface to measure"),
        (
            "repeated_index",
            "faces with a repeated vertex (number 12): they have no area and no normal; repair(mesh)",
        ),
        ("duplicate", "faces with the vertices of an earlier face (number 4): their area counts twice"),
        ("flat_face", "faces of zero area (number 0): distances across them are less accurate; remesh"),
        ("needle", "sliver faces (number 0): distances across them are less accurate; remesh"),
        ("unused_vertex", "finite vertices that no sound face uses (number 12): their distance to all"),
        ("seam", "vertices at the position of an earlier vertex (numbers 12, 13, 14): distances, bases and"),
        ("book", "edges of more than two faces (0–1): paths may cross from one sheet"),
        (
            "touching_tetrahedra",
            "vertices where several fans of faces meet (number 0): sheets touch at a single",
        ),
        ("rewound_face", "edges whose two faces have opposite winding (0–1, 0–2, 1–2): normals"),
        (
            "inward",
            "closed components with faces oriented inward (number 0): left and right are exchanged; repair",
        ),
        ("two_tetrahedra", "2 components with 50.0%, 50.0% of the area: distances between them are infinite"),
    ],
)
def test_each_defect_has_a_sentence(name, sentence):
    report = check(specimen(name).mesh)
    sentences = report.fatal if "fatal" in specimen(name).tags else report.warnings
    (found,) = (found for found in sentences if found.startswith(sentence))
    assert found in str(report)


def test_long_lists_are_cut_to_five():
    rewound = grid(9, 9).faces.copy()
    rewound[::2] = rewound[::2, ::-1]
    (warning,) = check(Mesh(grid(9, 9).vertices, rewound)).warnings
    assert "(1–9, 1–10, 2–10, 2–11, 3–11, … (176 in all))" in warning


def test_a_vertex_may_be_repeated_at_any_two_corners():
    mesh = Mesh(np.eye(3), [[0, 1, 2], [0, 0, 1], [0, 1, 1], [0, 1, 0]])
    assert check(mesh).repeated_index_faces.tolist() == [1, 2, 3]


def test_inward_has_no_meaning_where_the_winding_is_inconsistent():
    mesh = specimen("rewound_face").mesh
    for faces in (mesh.faces, mesh.faces[:, ::-1]):
        assert not len(check(Mesh(mesh.vertices, faces)).inward_components)


def test_edges_of_three_faces_are_no_boundary():
    assert len(check(specimen("book").mesh).boundary_edges) == 6


def test_closed_forms():
    assert check(torus(20, 15)).euler_number == 0
    assert check(mobius()).n_boundary_loops == 1
    sheet = check(Mesh(grid(3, 4).vertices * [1, 1, 0], grid(3, 4).faces))
    np.testing.assert_allclose(sheet.boundary_lengths, [10])
    np.testing.assert_allclose(check(specimen("annulus").mesh).n_boundary_loops, 2)


@pytest.mark.parametrize(("size", "length"), [(1e-310, 4e-310), (1e200, 4e200), (1.5e308, np.inf)])
def test_boundaries_of_any_size_are_measured(size, length):
    corners = size * np.array([[0.5, 0, 0], [0.5, 1, 0], [-0.5, 1, 0], [-0.5, 0, 0]])
    report = check(Mesh(corners, [[0, 1, 2], [0, 2, 3]]))
    np.testing.assert_allclose(report.boundary_lengths, [length])


def test_components_come_by_area():
    small, large = specimen("tetrahedron").mesh, torus()
    both = together(inside_out(small), large.moved(large.vertices + 9))
    report = check(both)
    assert report.component_vertices.tolist() == [48, 4]
    np.testing.assert_allclose(report.component_shares, np.array([large.area, small.area]) / both.area)
    assert report.inward_components.tolist() == [1]


def test_a_clean_report_reads_well():
    text = str(check(torus()))
    assert text.endswith("no defects")
    assert "components                                          1\n" in text
    assert repr(check(torus())) == "MeshReport(48 vertices, 96 faces, 0 fatal defects, 0 warnings)"
