"""The ball signature: closed forms, invariance, boundaries, and what it refuses."""

import numpy as np
import pytest
from scipy.special import jv

from isomatch import DescriptorError, Graph, Mesh, MeshError, PointCloud
from isomatch.decimation import decimate
from isomatch.descriptors import ball_signature, deviation_of
from shapes import disguised, flat_grid, icosphere
from zoo.made import soup

RADII = np.array([0.25, 0.35, 0.5])


def bent_sheet(embed, size=1.2, steps=120):
    """A flat square sheet around the origin, laid into space by an isometry of the plane; its centre vertex."""
    side = np.linspace(-size / 2, size / 2, steps + 1)
    u, v = (x.ravel() for x in np.meshgrid(side, side, indexing="ij"))
    row, column = (x.ravel() for x in np.meshgrid(np.arange(steps), np.arange(steps), indexing="ij"))
    a = row * (steps + 1) + column
    b, c, d = a + steps + 1, a + steps + 2, a + 1
    odd = ((row + column) % 2 == 1)[:, None, None]  # diagonals alternate, so that no direction is preferred
    cut = np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1)
    other = np.stack([np.stack([a, b, d], 1), np.stack([b, c, d], 1)], 1)
    faces = np.where(odd, cut, other).reshape(-1, 3)
    return Mesh(np.stack(embed(u, v), axis=1), faces), (steps // 2) * (steps + 2)


def at_centre(mesh, centre, **options):
    return ball_signature(mesh, RADII, unit=1.0, samples=[centre], **options).values[centre]


def test_plane():
    mesh, centre = bent_sheet(lambda u, v: (u, v, 0 * u))
    np.testing.assert_allclose(at_centre(mesh, centre), [[0, 0.5, 0.5, 0]] * 3, atol=0.004)


def test_cylinder():
    rho = 0.3
    mesh, centre = bent_sheet(lambda u, v: (rho * np.sin(u / rho), v, rho * np.cos(u / rho)))
    a = RADII / rho
    cosine, twice = 2 * jv(1, a) / a, jv(1, 2 * a) / a  # means of cos φ and cos 2φ over a disk
    around = np.sqrt(0.5 * (1 - twice)) / a
    up = np.sqrt(0.5 * (1 + twice) - cosine**2) / a
    expected = np.stack([(cosine - 1) / a, 0 * a + 0.5, around, up], axis=1)
    expected[:, 1:] = -np.sort(-expected[:, 1:], axis=1)
    np.testing.assert_allclose(np.abs(at_centre(mesh, centre)), np.abs(expected), atol=0.005)


@pytest.mark.parametrize("half_angle", [0.5, 1.0, 1.4])
def test_fold(half_angle):
    """Two half planes that meet at twice the half angle; the crease passes through the centre."""
    sine, cosine = np.sin(half_angle), np.cos(half_angle)
    mesh, centre = bent_sheet(lambda u, v: (u * sine, v, -np.abs(u) * cosine))
    centroid = 4 / (3 * np.pi)  # distance of the centroid of a half disk from its centre
    along, across, deep = 0.5, sine / 2, cosine * np.sqrt(0.25 - centroid**2)
    expected = [-centroid * cosine, *sorted([along, across, deep], reverse=True)]
    np.testing.assert_allclose(at_centre(mesh, centre), [expected] * 3, atol=0.006)


def test_rim_of_a_thin_slab():
    """A ball near the rim wraps around to the other side: its moments are integrals over a disk folded twice."""
    thickness, rim = 0.04, 0.1

    def embed(u, v):
        beyond = u - rim
        x = np.where(beyond < 0, u, np.where(beyond < thickness, rim, rim - (beyond - thickness)))
        z = np.where(beyond < 0, 0.0, np.where(beyond < thickness, -beyond, -thickness))
        return x, v, z

    mesh, centre = bent_sheet(embed, steps=240)
    radius, angle = np.meshgrid((np.arange(400) + 0.5) / 400, (np.arange(720) + 0.5) * np.pi / 360)
    weights = (radius / radius.sum()).ravel()
    for r, found in zip(RADII, at_centre(mesh, centre)):
        x, y = r * (radius * np.cos(angle)).ravel(), r * (radius * np.sin(angle)).ravel()
        disk = np.stack(embed(x, y), 1) / r
        middle = weights @ disk
        extents = np.sqrt(np.linalg.eigvalsh((disk - middle).T * weights @ (disk - middle))[::-1])
        np.testing.assert_allclose(found, [middle[2], *extents], atol=0.01)


@pytest.mark.parametrize("size", [0.5, 1.5])
def test_sphere(size):
    sphere = icosphere(5)
    angle = RADII / size  # a cap of this angle
    found = ball_signature(sphere.moved(size * sphere.vertices), RADII, unit=1.0, samples=[0, 17, 4711])
    cosine = np.cos(angle)
    above = (1 + cosine + cosine**2) / 3  # mean square of the height, which is uniform between cos and 1
    across = np.sqrt((1 - above) / 2) / angle
    up = (1 - cosine) / np.sqrt(12) / angle
    expected = np.stack([-(1 - cosine) / 2 / angle, across, across, up], axis=1)
    expected[:, 1:] = -np.sort(-expected[:, 1:], axis=1)
    for vertex in (0, 17, 4711):
        np.testing.assert_allclose(found.values[vertex], expected, atol=0.01)


def test_tip_of_a_cone():
    steps, turns = 60, 96
    sine, cosine = np.sin(0.6), np.cos(0.6)  # of the half angle
    turn = np.arange(turns) * 2 * np.pi / turns
    ring = np.stack([sine * np.cos(turn), sine * np.sin(turn), np.full(turns, -cosine)], 1)
    rings = (np.linspace(0, 0.7, steps + 1)[1:, None, None] * ring).reshape(-1, 3)
    column = np.arange(turns)
    tip = np.stack([0 * column, 1 + column, 1 + (column + 1) % turns], 1)
    inner = (1 + turns * np.arange(steps - 1))[:, None]
    a, b = inner + column, inner + (column + 1) % turns
    faces = [tip, *(np.stack(x, -1).reshape(-1, 3) for x in ((a, a + turns, b), (b, a + turns, b + turns)))]
    cone = Mesh(np.vstack([[[0, 0, 0]], rings]), np.concatenate(faces))
    expected = [-2 / 3 * cosine, *sorted([sine / 2, sine / 2, cosine / np.sqrt(18)], reverse=True)]
    np.testing.assert_allclose(at_centre(cone, 0), [expected] * 3, atol=0.008)


def test_hollow_and_bump_differ_in_the_sign_of_the_offset(example):
    mesh = example[0].mesh
    outside = ball_signature(mesh, samples=[5, 50, 500])
    inside = ball_signature(Mesh(mesh.vertices, mesh.faces[:, ::-1]), samples=[5, 50, 500])
    np.testing.assert_allclose(inside.values[..., 0], -outside.values[..., 0], atol=1e-9)
    np.testing.assert_allclose(inside.values[..., 1:], outside.values[..., 1:], atol=1e-9)


def test_motion_scale_and_labels_change_nothing(example):
    mesh = example[0].mesh
    other = disguised(mesh, seed=3, scale=37.0)
    plain, moved = ball_signature(mesh), ball_signature(other.mesh)
    assert np.abs(plain.values).max() > 0.5
    np.testing.assert_allclose(moved.values[other.new_vertex], plain.values, atol=1e-3)


def test_remeshing_changes_little(example):
    """Half the vertices: the differences are small against those between places."""
    mesh = example[0].mesh
    coarse = decimate(mesh, mesh.n_vertices // 2)
    nearest = np.array([np.linalg.norm(mesh.vertices - x, axis=1).argmin() for x in coarse.mesh.vertices])
    fine, rough = ball_signature(mesh), ball_signature(coarse.mesh, unit=np.sqrt(mesh.area))
    same = rough.descriptor_distance(fine.at(nearest))
    shuffled = rough.descriptor_distance(fine.at(np.random.default_rng(0).permutation(nearest)))
    assert np.median(same) < 0.25 * np.median(shuffled)


def test_a_cut_changes_nothing_where_it_is_far(example):
    mesh, unit = example[0].mesh, np.sqrt(example[0].mesh.area)
    axis = np.ptp(mesh.vertices, axis=0).argmax()
    part, kept = mesh.submesh(mesh.vertices[:, axis] > np.median(mesh.vertices[:, axis]))
    whole, cut = ball_signature(mesh), ball_signature(part, unit=unit)
    assert whole.known.all()
    assert 0.02 < cut.known[:, 0].mean() < 1.0
    far = cut.known & (cut.radii <= cut.to_boundary[:, None] - 0.03)
    assert far.sum() > 100
    np.testing.assert_allclose(cut.values[far], whole.values[kept][far], atol=1e-6)


def test_values_at_other_vertices_are_means_of_near_samples(example):
    mesh = example[0].mesh
    every = ball_signature(mesh)
    some = ball_signature(mesh, samples=np.arange(0, mesh.n_vertices, 3))
    few = ball_signature(mesh, samples=[7])
    assert np.median(every.descriptor_distance(some)) < 0.2
    np.testing.assert_allclose(few.values, np.broadcast_to(few.values[7], few.values.shape), atol=1e-12)


@pytest.mark.long
def test_scaled_is_the_signature_of_the_larger_surface(example):
    mesh = example[0].mesh
    radii = np.geomspace(0.05, 0.2, 12)
    ladder = ball_signature(mesh, radii)
    larger = ball_signature(mesh.moved(1.3 * mesh.vertices), [0.09, 0.13], unit=np.sqrt(mesh.area))
    np.testing.assert_allclose(ladder.scaled(1.3, [0.09, 0.13]).values, larger.values, atol=0.01)


def test_descriptor_distance_counts_what_is_known_of_both(example):
    found = ball_signature(example[0].mesh)
    assert (found.descriptor_distance(found) == 0).all()
    unknown = type(found)(found.radii, found.values, np.where(np.arange(len(found.values)) < 5, -1.0, np.inf))
    compared = found.descriptor_distance(unknown)
    assert np.isnan(compared[:5]).all()
    assert (compared[5:] == 0).all()
    assert (deviation_of(found) >= 0.03).all()


@pytest.mark.long
def test_clouds_with_normals(example):
    mesh = example[0].mesh
    cloud = ball_signature(PointCloud(mesh.vertices), normals=mesh.vertex_normals)
    same = ball_signature(mesh)
    shuffled = same.at(np.random.default_rng(0).permutation(mesh.n_vertices))
    medians = (np.median(cloud.descriptor_distance(signature)) for signature in (same, shuffled))
    assert next(medians) < 0.5 * next(medians)


@pytest.mark.parametrize(
    ("make", "options", "message"),
    [
        (lambda: Graph(3, [[0, 1], [1, 2]], [1.0, 1.0]), {}, "no normals"),
        (lambda: PointCloud(icosphere(2).vertices), {}, "needs normals"),
        (lambda: PointCloud(icosphere(2).vertices), {"normals": np.zeros((3, 3))}, r"expected \(162, 3\)"),
        (lambda: icosphere(2), {"radii": [0.2, 0.1]}, "increase"),
        (lambda: icosphere(2), {"radii": []}, "increase"),
        (lambda: icosphere(2), {"samples": []}, "samples is empty"),
    ],
)
def test_what_it_refuses(make, options, message):
    with pytest.raises(DescriptorError, match=message):
        ball_signature(make(), **options)


@pytest.mark.parametrize("mesh", [icosphere(1), soup(icosphere(1))], ids=["sphere", "soup"])
def test_samples_and_normals_of_other_surfaces(mesh):
    for samples in ([-1], [mesh.n_vertices], [0.5]):
        with pytest.raises(MeshError, match=r"outside|indices"):
            ball_signature(mesh, samples=samples)
    with pytest.raises(DescriptorError, match="expected"):
        ball_signature(mesh, normals=np.zeros((3, 3)))


def test_signatures_that_cannot_be_compared():
    sphere = icosphere(2)
    with pytest.raises(DescriptorError, match="cannot be compared"):
        ball_signature(sphere, [0.2]).descriptor_distance(ball_signature(sphere, [0.3]))


def test_a_flat_sheet_without_extent_in_one_direction():
    found = ball_signature(flat_grid(12, 12), [0.3])
    np.testing.assert_allclose(found.values[..., 3], 0, atol=1e-9)
