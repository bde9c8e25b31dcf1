"""What is left out of a study is named once, and is an error with --strict; names stay inside their folders."""

import pytest

from isomatch import InputError, Landmarks, Mesh, write_landmarks, write_mesh
from isomatch._core.skipped import telling_once
from isomatch.cli import main
from isomatch.cohort import Collection
from isomatch.cohort.landmarks import landmark_files
from isomatch.cohort.plan import entries_of
from isomatch.cohort.study_input import read_study
from isomatch.cohort.subjects import structures_of
from shapes import icosphere

BALL = icosphere(1)
OUTSIDE = ["../bone", "/tmp/bone", "a/b", "a\\b", "..", ".", "C:bone", "con", "LPT1.old", "a?", "bone."]
OUTSIDE += [" bone", "x" * 300]


@pytest.fixture
def scans(tmp_path):
    (tmp_path / "scans").mkdir()
    for name in ("a", "b"):
        write_mesh(tmp_path / "scans" / f"{name}.ply", BALL)
    return tmp_path / "scans"


@pytest.mark.parametrize("name", OUTSIDE)
@pytest.mark.parametrize("kind", ["shape", "subject", "structure"])
def test_names_stay_inside(scans, kind, name):
    quoted = f'"{name}"'
    table = scans.parent / "list.csv"
    rows = {
        "shape": [f"{quoted},scans/a.ply"],
        "subject": [f"{quoted},bone,scans/a.ply", "b,bone,scans/b.ply"],
    }
    rows["structure"] = [f"a,{quoted},scans/a.ply", f"b,{quoted},scans/b.ply"]
    header = "name,path" if kind == "shape" else "subject,structure,file"
    table.write_text("\n".join([header, *rows[kind]]))
    read = entries_of if kind == "shape" else structures_of
    if name == " bone":  # blanks around a cell are none of its name
        read(table)
        return
    with pytest.raises(InputError, match=f"cannot be the name of a {kind}"):
        read(table)


def test_links_files_and_folders_that_are_left_out_are_named_once(scans, caplog):
    (scans / "c.ply").symlink_to(scans / "nowhere.ply")
    (scans / "d.fbx").write_bytes(b"")
    (scans / "more").mkdir()
    write_mesh(scans / "more" / "e.ply", BALL)
    with telling_once(strict=False):
        for _ in range(2):
            assert [entry.name for entry in entries_of(scans)] == ["a", "b"]
    told = [record.getMessage() for record in caplog.records]
    assert len(told) == 3
    assert "c.ply: left out, as it leads nowhere" in told[0] + told[1]
    assert "d.fbx: left out, as .fbx files are not read; export it as GLB" in told[0] + told[1]
    assert "in its folders more are left out" in told[2]
    with telling_once(strict=True), pytest.raises(InputError, match="--strict"):
        entries_of(scans)


def test_subjects_without_a_surface_and_structures_alike_but_for_case(scans, caplog):
    for subject in ("s1", "s2", "empty"):
        (scans.parent / "in" / subject).mkdir(parents=True)
    for subject, structure in (("s1", "bone"), ("s2", "bone")):
        write_mesh(scans.parent / "in" / subject / f"{structure}.ply", BALL)
    assert [*structures_of(scans.parent / "in")] == ["bone"]
    assert "empty left out, with no surface that can be read" in caplog.text
    for subject in ("s3", "s4"):
        (scans.parent / "in" / subject).mkdir()
        write_mesh(scans.parent / "in" / subject / "Bone.ply", BALL)
    with pytest.raises(InputError, match="differ in case or accents alone"):
        structures_of(scans.parent / "in")


@pytest.mark.parametrize("other", ["alike", "moved", "damaged"])
def test_marks_of_no_shape_and_two_files_of_one_are_named(scans, caplog, other):
    marks = scans.parent / "marks"
    marks.mkdir()
    own = Landmarks(BALL.vertices[[0, 5, 7]], "uvw")
    write_landmarks(marks / "a.mrk.json", own)
    write_landmarks(marks / "a_landmarks.csv", own)
    write_landmarks(
        marks / "a.fcsv", Landmarks(BALL.vertices[[1, 5, 7]] if other == "moved" else own.positions, "uvw")
    )
    if other == "damaged":
        (marks / "a.fcsv").write_text("nothing")
    collection = Collection.create(scans.parent / "out", scans)
    assert landmark_files(marks, collection, "b") == {"a": marks / "a.mrk.json"}
    assert "a_landmarks.csv left out, named like no shape" in caplog.text
    assert ("a has the landmarks of a.mrk.json; a.fcsv, which has others, is left out" in caplog.text) == (
        other != "alike"
    )


def test_a_shape_without_a_group_or_faces_is_named(scans, caplog):
    (scans.parent / "groups.csv").write_text('"name","group"\n"a","m"\n"b",NA\n')
    write_mesh(scans / "empty.off", Mesh([[0.0, 0, 0]], []))
    study = read_study(scans, scans.parent / "groups.csv")
    shapes, labels = study.shapes, study.groups
    assert (shapes.names, labels) == (("a", "b"), {"a": "m"})
    assert "empty: left out, as it has no faces" in caplog.text


def test_strict_is_an_option_of_every_command(scans, capsys):
    assert main(["check", str(scans)]) == 0
    (scans / "c.ply").symlink_to(scans / "nowhere.ply")
    assert main(["check", str(scans)]) == 0
    for words in (["--strict", "check", str(scans)], ["check", str(scans), "--strict"]):
        assert main(words) == 1
        assert (
            "c.ply: left out, as it leads nowhere; an error, as --strict was given" in capsys.readouterr().err
        )
