"""Subjects of several surfaces in one topology: motions, shares, missing and hidden structures, their files."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import isomatch
from corresponded import moved, random_shapes
from isomatch._core.errors import FormatError, InputError, MeshError
from isomatch.cli import main
from isomatch.cohort.shape_statistics import (
    CorrespondedShapes,
    ShapeModel,
    aligned_structures,
    hidden_structures,
    read_observations,
    read_shapes,
    slices_of,
    stacked,
    structure_of,
)
from shapes import icosphere
from small_collections import lopsided_blob

N = 42  # vertices of a structure


def subjects(n_subjects=8, poses=0.0, seed=0):
    """A large, a middle and a small structure beside each other; each turned and shifted by itself, if asked."""
    rng = np.random.default_rng(seed)
    parts = {}
    for k, (name, size) in enumerate({"femur": 3.0, "tibia": 2.0, "patella": 1.0}.items()):
        part = random_shapes(n_subjects, 5, seed=seed + k)
        turns = Rotation.from_rotvec(poses * rng.normal(size=(n_subjects, 3))).as_matrix()
        shifts = poses * rng.normal(size=(n_subjects, 1, 3))
        turned = np.einsum("sij,snj->sni", turns, size * part.vertices)
        parts[name] = part.moved(turned + shifts + [10.0 * k, 4.0 * (k == 2), 0])
    return parts


def without(shapes, missing):
    """The same subjects, some of which lack a structure: it was not measured, and lies anywhere."""
    measured, vertices = shapes.seen.copy(), shapes.vertices.copy()
    for i, name in missing.items():
        part = slices_of(shapes.structures)[name]
        measured[i, part] = False
        vertices[i, part] += 100.0
    return CorrespondedShapes(shapes.names, vertices, shapes.faces, (), measured, shapes.structures)


def test_a_motion_of_a_structure_is_in_the_joint_model_and_gone_where_each_is_aligned_by_itself():
    still, shaken = stacked(subjects()), moved(stacked(subjects(poses=0.3)))
    assert ShapeModel.fit(shaken).variances.sum() > 2 * ShapeModel.fit(still).variances.sum()
    models = [ShapeModel.fit(aligned_structures(shapes).shapes) for shapes in (still, shaken)]
    np.testing.assert_allclose(models[1].variances, models[0].variances, rtol=1e-6)
    # a joint alignment of structures that are aligned by themselves leaves them where they are
    alone = aligned_structures(shaken).shapes
    np.testing.assert_allclose(models[1].aligned, alone.vertices, atol=1e-7)


def test_poses_are_those_that_were_given():
    parts = {name: part.moved(np.repeat(part.vertices[:1], 6, axis=0)) for name, part in subjects(6).items()}
    angles = 0.02 * np.array([-2.5, -1.5, -0.5, 0.5, 1.5, 2.5])
    turns = Rotation.from_rotvec(angles[:, None] * [0, 0, 1.0]).as_matrix().transpose(0, 2, 1)
    patella, centre = parts["patella"], parts["patella"].vertices[0].mean(axis=0)
    parts["patella"] = patella.moved((patella.vertices - centre) @ turns + centre)
    poses = aligned_structures(stacked(parts))
    # of the difference of two structures no common alignment can take anything
    found = poses.rotations[:, 2] - poses.rotations[:, 0]
    np.testing.assert_allclose(found[:, 2] - found[:, 2].mean(), angles, atol=1e-3)
    assert poses.shares.tolist() == pytest.approx([1, 1, 1])


def test_each_structure_weighs_the_same_and_shares_sum_to_one(tmp_path):
    shapes = stacked(subjects())
    sums = [shapes.area_weights[part].sum() for part in slices_of(shapes.structures).values()]
    assert sums == pytest.approx([1 / 3] * 3)
    model = ShapeModel.fit(shapes)
    np.testing.assert_allclose(sum(model.structure_shares.values()), 1)
    total = sum(model.variances @ shares for shares in model.structure_shares.values())
    assert total == pytest.approx(model.variances.sum())
    model.save(tmp_path / "model.npz")
    loaded = ShapeModel.load(tmp_path / "model.npz")
    assert list(loaded.structures.items()) == [("femur", N), ("tibia", N), ("patella", N)]


def test_a_missing_structure_adds_no_variance_and_stays_missing():
    whole = stacked(subjects(poses=0.1))
    lacking = without(whole, {1: "femur", 4: "patella"})
    part = slices_of(whole.structures)["femur"]
    femur = ShapeModel.fit(lacking).aligned[:, part]
    np.testing.assert_allclose(femur[1], np.delete(femur, 1, axis=0).mean(axis=0), atol=1e-4)
    poses = aligned_structures(lacking)
    assert np.argwhere(np.isnan(poses.rotations[:, :, 0])).tolist() == [[1, 0], [4, 2]]


def test_a_hidden_structure_that_is_told_by_the_others_is_found_better_than_by_the_mean():
    femur = random_shapes(12, 2, spread=0.3)
    patella = femur.moved(0.5 * femur.vertices + [8.0, 0, 0])
    alone = random_shapes(12, 2, seed=5, spread=0.3)
    shapes = stacked({"femur": femur, "patella": patella, "other": alone.moved(alone.vertices - [8.0, 0, 0])})
    found = hidden_structures(shapes, ["patella"])
    assert [each["name"] for each in found] == [*shapes.names]
    error, of_mean = (np.mean([each[name] for each in found]) for name in ("error", "mean_error"))
    assert error < 0.5 * of_mean


def test_bad_arguments():
    shapes = stacked(subjects(4))
    for hidden in (["shin"], [*shapes.structures]):
        with pytest.raises(InputError, match=r"cannot be hidden of 4 subjects of .'femur', 'tibia'"):
            hidden_structures(shapes, hidden)
    with pytest.raises(MeshError, match="are not 126 vertices"):
        CorrespondedShapes(shapes.names, shapes.vertices, shapes.faces, structures={"femur": 5})


def write(folder, shapes):
    """The files of subjects, as `isomatch collect` writes them."""
    folder.mkdir()
    for i, name in enumerate(shapes.names):
        own = [isomatch.Attribute("measured", "point", "label", shapes.seen[i].astype(np.uint8))]
        isomatch.write_asset(folder / f"{name}.ply", isomatch.Asset.of_mesh(shapes.mesh(i), own))
    lines = "".join(f"{name},{n}\n" for name, n in shapes.structures.items())
    (folder / "structures.csv").write_text("structure,vertices\n" + lines)
    return folder


def test_files_of_subjects(tmp_path):
    shapes = without(stacked(subjects()), {0: "femur"})
    read = read_shapes(write(tmp_path / "corresponded", shapes))
    assert read.structures == shapes.structures
    assert read.names == shapes.names  # also that which lacks most of its vertices
    np.testing.assert_array_equal(read.measured, shapes.measured)
    (tmp_path / "corresponded" / "structures.csv").write_text("structure\nfemur\n")
    with pytest.raises(FormatError, match=r"structures.csv: not the structures of subjects"):
        read_shapes(tmp_path / "corresponded")


@pytest.mark.long
@pytest.mark.usefixtures("coarse_pictures")
def test_commands(tmp_path, capsys):
    shapes = without(stacked(subjects(poses=0.1)), {5: "tibia"})
    write(tmp_path / "corresponded", shapes)
    out = tmp_path / "statistics"
    assert main(["statistics", str(tmp_path), "-o", str(out), "--hide", "patella"]) == 0
    assert "patella has" in capsys.readouterr().out
    record = json.loads((out / "statistics.json").read_text())
    assert sum(own["share"] for own in record["structures"]) == pytest.approx(1)
    assert {"structures.csv", "poses.csv", "hidden.csv"} <= set(record["files"])
    aligned = ["statistics", str(tmp_path), "-o", str(tmp_path / "alone"), "--align", "structure", "--json"]
    assert main(aligned) == 0
    assert json.loads(capsys.readouterr().out)["total_variance"] < record["total_variance"]

    # a new subject, moved, of which the patella is missing
    new, model = tmp_path / "new", ShapeModel.load(out / "model.npz")
    new.mkdir()
    turned = Rotation.from_rotvec([0, 0, 1]).apply(shapes.vertices[2].copy()) + 5
    truth = isomatch.Mesh(turned, shapes.faces)
    for name, part in slices_of(shapes.structures).items():
        if name != "patella":
            isomatch.write_mesh(new / f"{name}.ply", structure_of(truth, part))
    argv = ["statistics", "complete", str(out / "model.npz"), str(new)]
    assert main([*argv, "-o", str(tmp_path / "whole")]) == 0
    found = isomatch.read_mesh(tmp_path / "whole" / "patella.ply")
    error = np.sqrt(((found.vertices - truth.vertices[2 * N :]) ** 2).sum(axis=1).mean())
    assert error < 0.5
    isomatch.write_mesh(new / "shin.ply", icosphere(1))
    with pytest.raises(InputError, match=r"give some of the structures of the model, .'femur'"):
        read_observations(new, model)
    capsys.readouterr()
    assert main(["statistics", str(out / "aligned"), "-o", str(tmp_path / "x"), "--hide", "a"]) == 1
    assert "--hide and --align structure are" in " ".join(capsys.readouterr().err.split())


@pytest.mark.long
def test_a_known_structure_in_another_triangulation(tmp_path):
    blobs = [lopsided_blob(2, i, 0.02) for i in range(4)]
    femur = CorrespondedShapes("abcd", [blob.vertices for blob in blobs], blobs[0].faces)
    model = ShapeModel.fit(stacked({"femur": femur, "patella": femur.moved(femur.vertices / 2 + 5)}))
    truth = blobs[1].vertices
    order = np.random.default_rng(0).permutation(len(truth))
    isomatch.write_mesh(tmp_path / "femur.ply", isomatch.Mesh(truth[order], np.argsort(order)[femur.faces]))
    known = read_observations(tmp_path, model)
    np.testing.assert_allclose(known.positions, truth, atol=0.1)
