"""The map from the receiving asset to the giving one, and what follows from it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array

from isomatch._core.arrays import AnyArray, BoolArray, FloatArray, IntArray
from isomatch._core.cached import cached_property
from isomatch._core.errors import MeshError
from isomatch.correspondence import UNMATCHED, Correspondence, nearest_rotation, welded_map
from isomatch.decimation import PlacedMesh, Prolongation, VertexGroups, decimate, normalised
from isomatch.io import Asset, Attribute
from isomatch.spectral import factorise_for_threads, stiffness_and_masses
from isomatch.surfaces import Mesh, PrecisePoints, first_equal

# The search for the image of a corner met a seam if it ends farther from the image than this, in half extents of
# the giver; chosen.
ACROSS_SEAM_DISTANCE = 1e-6
# ratio of the sizes of giver and receiver below which they are taken as equal, as bending and errors of the map
# explain such a ratio; chosen
SAME_SIZE_RATIO = 1.1
# Length in √area of the receiver over which the rotations of shape keys are averaged. On bodies and heads of
# different people, for keys whose displacements have one direction, the median angle between the
# displacements carried is at most 4°, and with half this length 6°.
SMOOTHING_LENGTH = 0.1
# number of vertices of the mesh for these averages; chosen: its edges are a sixth of `SMOOTHING_LENGTH`
N_COARSE_VERTICES = 4000
LAPLACIAN_SHIFT = 1e-9  # added to a singular Laplacian, in 1 / area, to make it definite; chosen


@dataclass(frozen=True, eq=False)
class Places:
    """Points on an asset: the triangle of its polygons that holds each, and the weights of its corners."""

    asset: Asset
    triangle: IntArray  # the triangle (m,) of each point; −1 if it has no place
    barycentric: FloatArray  # weights (m, 3) of the corners of the triangles

    @property
    def has_place(self) -> BoolArray:
        """Which points have a place, (m,)."""
        return self.triangle >= 0

    def rows(self, attribute: Attribute) -> IntArray:
        """(m, 3) row of an attribute at each corner of the triangles."""
        return rows_of_corners(self.asset, attribute)[self.asset.polygons.corner_of_triangle[self.triangle]]

    def nearest_rows(self, attribute: Attribute) -> IntArray:
        """(m,) row of an attribute at the nearest corner of the triangle."""
        nearest = self.barycentric.argmax(axis=1)
        return np.asarray(self.rows(attribute)[np.arange(len(nearest)), nearest])

    def interpolated(self, values: FloatArray, rows: IntArray) -> FloatArray:
        """Interpolate rows (m, 3) of values (n, d): (m, d), nan where a point has no place."""
        total = PrecisePoints(rows, self.barycentric).interpolated(values)
        total[~self.has_place] = np.nan
        return total


@dataclass(frozen=True, eq=False)
class Bridge:
    """A map from the mesh of the asset that receives to the mesh of the one that gives."""

    map: Correspondence  # maps receiver.mesh → giver.mesh
    receiver: Asset
    giver: Asset

    @classmethod
    def between(cls, images: Correspondence, source: Asset, target: Asset, *, to_source: bool) -> Bridge:
        """Make the bridge of a map source → target between the points of two files, or between their meshes."""
        for name, asset in (("source", source), ("target", target)):
            if not len(asset.polygons):
                reason = "has no polygons, and values are carried between surfaces"
                raise MeshError(f"{name}: {reason}; give a mesh")
        meshes, vertices = zip(*map(_mesh_of_map, (source, target), images.shape))
        images.check_fits(*meshes)
        welded = welded_map(images, *vertices)
        if to_source:
            return cls(welded, source, target)
        return cls(welded.reversed(source.mesh, target.mesh), target, source)

    @cached_property
    def at_vertices(self) -> Places:
        """Places of the vertices of the receiver's mesh."""
        return self._places(self.map)

    @cached_property
    def image_positions(self) -> FloatArray:
        """Positions (n_vertices, 3) of the images of the receiver's vertices."""
        return self.map.pull_back(self.giver.mesh.vertices)

    def at(self, points: PrecisePoints) -> Places:
        """Find the places of points of the receiver's mesh."""
        samples = Correspondence.of_points(points, self.receiver.mesh.n_vertices)
        return self._places(samples.then(self.map, self.receiver.mesh, self.giver.mesh))

    @cached_property
    def at_thirds(self) -> Places:
        """Places of the middles of the thirds of the receiver's triangles, three per triangle."""
        return self.at(self._in_triangles(np.full((3, 3), 1 / 6) + np.eye(3) / 2))

    @cached_property
    def at_polygons(self) -> Places:
        """Place of the middle of each polygon's largest triangle."""
        polygons = self.receiver.polygons
        by_size = np.lexsort([-self.receiver.mesh.face_areas, polygons.of_triangle])
        largest = by_size[np.unique(polygons.of_triangle[by_size], return_index=True)[1]]
        middles = self._in_triangles(np.full((1, 3), 1 / 3))
        return self.at(PrecisePoints(middles.corners[largest], middles.barycentric[largest]))

    def _in_triangles(self, weights: FloatArray) -> PrecisePoints:
        faces = self.receiver.mesh.faces
        return PrecisePoints(np.repeat(faces, len(weights), axis=0), np.tile(weights, (len(faces), 1)))

    def _places(self, images: Correspondence) -> Places:
        """Find the triangles of precise images; images outside triangles move to their nearest vertex."""
        faces = self.giver.mesh.faces
        order, corner_order = np.argsort(images.faces, axis=1), np.argsort(faces, axis=1)
        triples = np.take_along_axis(images.faces, order, axis=1)
        sorted_faces = np.take_along_axis(faces, corner_order, axis=1)
        triangle = first_equal(np.concatenate([sorted_faces, triples]))[len(faces) :]
        inside = images.matched & (triangle < len(faces))
        triangle[~inside] = UNMATCHED
        barycentric, placed = np.zeros((len(triples), 3)), np.flatnonzero(inside)
        sorted_weights = np.take_along_axis(images.barycentric, order, axis=1)
        barycentric[placed[:, None], corner_order[triangle[placed]]] = sorted_weights[placed]
        corner_of_vertex = np.full(self.giver.mesh.n_vertices, UNMATCHED)
        corner_of_vertex[faces.ravel()] = np.arange(faces.size)
        outside = np.flatnonzero(images.matched & ~inside)
        corner = corner_of_vertex[images.faces[outside, images.barycentric[outside].argmax(axis=1)]]
        triangle[outside] = np.where(corner >= 0, corner // 3, UNMATCHED)
        barycentric[outside, corner % 3] = 1.0
        return Places(self.giver, triangle, barycentric)

    @cached_property
    def growth(self) -> float:
        """Ratio of sizes, receiver to giver: a median over matched faces; 1 if about equal."""
        faces = self.receiver.mesh.faces
        faces = faces[self.map.matched[faces].all(axis=1)]
        both = self.receiver.mesh.vertices[faces], self.image_positions[faces]
        sides = (np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2) for x in both)
        receiver_lengths, giver_lengths = (lengths.sum(axis=1) for lengths in sides)
        ratios = receiver_lengths[giver_lengths > 0] / giver_lengths[giver_lengths > 0]
        ratio = float(np.median(ratios)) if len(ratios) else 1.0
        return 1.0 if 1 / SAME_SIZE_RATIO < ratio < SAME_SIZE_RATIO else ratio

    @cached_property
    def rotations(self) -> FloatArray:
        """Rotations (n_vertices, 3, 3) from giver to receiver; identity if no neighbour matches."""
        return self._nearest_rotations(self._fits)

    @cached_property
    def smooth_rotations(self) -> FloatArray:
        """Rotations (n_vertices, 3, 3), averaged over `SMOOTHING_LENGTH`."""
        # With the stiffness L and the areas A of the receiver, (A + t L) X = Σ HᵀG, the fits of `_fits`, is
        # one implicit step of diffusion: X is an average of the fits, with weights that fall off over the
        # length √t. A coarse mesh suffices for that.
        part, kept = self._sound_part
        if not len(kept):
            return self.rotations
        coarse = decimate(part, N_COARSE_VERTICES)
        summed = np.zeros((coarse.mesh.n_vertices, 9))
        np.add.at(summed, coarse.owner, self._fits[kept].reshape(-1, 9))
        stiffness, areas = stiffness_and_masses(coarse.mesh)
        averages = factorise_for_threads(SMOOTHING_LENGTH**2 * areas.sum() * stiffness, areas)(summed)
        fits = self._fits.copy()
        fits[kept] = Prolongation(part, coarse).on_coarse.interpolated(averages).reshape(-1, 3, 3)
        return self._nearest_rotations(fits)

    def extended(self, moves: FloatArray) -> FloatArray:
        """Extend displacements (n_vertices, 3) harmonically to unmatched vertices; 0 if none is linked."""
        unmatched, extend = self._extension
        extended = np.nan_to_num(moves)
        extended[unmatched] = extend(extended)
        return extended

    @cached_property
    def _extension(self) -> tuple[IntArray, Callable[[FloatArray], AnyArray]]:
        """Unmatched vertices, and a function that extends displacements (0 there) to them."""
        # L u = 0 at unmatched vertices: L_uu u_u = −L_um u_m, with u for unmatched and m for matched
        # vertices. The shift makes L_uu definite on components without matched vertices.
        part, kept = self._sound_part
        rows = np.flatnonzero(~self.at_vertices.has_place[kept])
        if not len(rows):
            return rows, lambda moves: moves[rows]
        stiffness, areas = stiffness_and_masses(part)
        around = stiffness[rows]
        solve = factorise_for_threads(csc_array(around[:, rows]), LAPLACIAN_SHIFT / areas.sum() * areas[rows])
        return kept[rows], lambda moves: solve(-(around @ moves[kept]))

    @cached_property
    def _sound_part(self) -> tuple[Mesh, IntArray]:
        """The receiver's mesh without flat faces and unused vertices, and its vertices' numbers."""
        mesh = self.receiver.mesh
        whole = Mesh(mesh.vertices, mesh.faces[mesh.face_areas > 0])
        return whole.submesh(whole.vertex_areas > 0)

    @cached_property
    def _fits(self) -> FloatArray:
        """(n_vertices, 3, 3) Σ Hᵀ G over the faces at each vertex."""
        # The rotation R_v maximises Σ_f tr(Rᵀ Hᵀ G) over the faces f at v. H on the receiver, and G at the
        # images on the giver, have as rows two edges of f, and its normal, as long as both edges together:
        # orthogonal Procrustes (Kabsch 1976) by the SVD of Σ HᵀG.
        mesh = self.receiver.mesh
        normals = self.map.pull_back(self.giver.mesh.vertex_normals)
        frames = []
        for x, upright in ((mesh.vertices, mesh.vertex_normals), (self.image_positions, normals)):
            a, b, c = (x[mesh.faces[:, k]] for k in range(3))
            size = np.linalg.norm(b - a, axis=1) + np.linalg.norm(c - a, axis=1)
            normal = upright[mesh.faces].mean(axis=1) * size[:, None]
            frames.append(np.stack([b - a, c - a, normal], axis=1))
        fit = np.nan_to_num(np.einsum("fri,frj->fij", *frames))
        summed = np.zeros((mesh.n_vertices, 3, 3))
        for k in range(3):
            np.add.at(summed, mesh.faces[:, k], fit)
        return summed

    def _nearest_rotations(self, fits: FloatArray) -> FloatArray:
        """Return the rotations (n, 3, 3) nearest to fits, or reflections if the map mirrors; identity for 0."""
        # The map mirrors if det Σ HᵀG < 0 at most vertices.
        is_mirrored = bool(np.sign(np.linalg.det(self._fits)).sum() < 0)
        turns = nearest_rotation(fits, mirrored=is_mirrored)
        turns[(fits == 0).all(axis=(1, 2))] = np.eye(3)
        return turns


@dataclass(frozen=True, eq=False)
class Patches:
    """Pieces of the receiver's surface; their areas weight votes for labels and means."""

    area: FloatArray  # the area of each piece
    owner: IntArray  # the vertex, corner or polygon that each piece belongs to
    rows: IntArray  # the row of an attribute of the giver at each piece
    owner_of_row: IntArray  # the owner of each row of the receiver

    @classmethod
    def of(cls, attribute: Attribute, bridge: Bridge) -> Patches:
        """Make the pieces of the domain of an attribute: thirds of triangles that have a place."""
        receiver = bridge.receiver
        triangles = receiver.polygons.corner_of_triangle.ravel()
        owner, owner_of_row = {
            "point": (receiver.mesh.faces.ravel(), receiver.vertex_of_point),
            "corner": (triangles, np.arange(len(receiver.polygons.corners))),
            "face": (receiver.polygons.of_corner[triangles], np.arange(len(receiver.polygons))),
        }[attribute.domain]
        places, pieces = bridge.at_thirds, np.flatnonzero(bridge.at_thirds.has_place)
        area = np.repeat(receiver.mesh.face_areas, 3)[pieces] + np.finfo(float).tiny
        return cls(area, owner[pieces], places.nearest_rows(attribute)[pieces], owner_of_row)

    def sums(self, of_piece: IntArray, n: int) -> csr_array:
        """Sum the areas of the pieces with each of n values, for each owner: (n_owners, n)."""
        n_owners = int(self.owner_of_row.max(initial=-1)) + 1
        return csr_array((self.area, (self.owner, of_piece)), shape=(n_owners, n))


def is_seamless(asset: Asset, attribute: Attribute) -> bool:
    """Whether all corners at one vertex of the mesh have the same values."""
    first = _first_corners(asset, attribute)
    return len(np.unique(first)) == len(np.unique(asset.vertex_of_corner))


def interpolated_at_corners(bridge: Bridge, attribute: Attribute) -> tuple[FloatArray, int]:
    """Interpolate at the corners of the receiver, (c, d), nan without an image; count its polygons across a seam."""
    # The giver's mesh is cut along its seams. The search for the images of a polygon's corners
    # starts at the place of the polygon's middle and walks to nearer neighbours. If a corner lies
    # beyond a seam, the search ends at the cut.
    giver, receiver = bridge.giver, bridge.receiver
    first = _first_corners(giver, attribute)
    corner_of_piece, piece = np.unique(first, return_inverse=True)
    positions = normalised(giver.mesh.vertices)[0]
    cut = Mesh(positions[giver.vertex_of_corner[corner_of_piece]], piece[giver.polygons.corner_of_triangle])
    polygon = receiver.polygons.of_corner
    start = bridge.at_polygons.triangle[polygon]
    images = bridge.map.pull_back(positions)[receiver.vertex_of_corner]
    with_image = np.flatnonzero((start >= 0) & bridge.map.matched[receiver.vertex_of_corner])
    walk = PlacedMesh(cut, cut.vertices, VertexGroups.of(np.arange(cut.n_vertices), cut.n_vertices))
    places = walk.inverse(images[with_image], cut.faces[start[with_image]])
    miss_distance = np.linalg.norm(places.interpolated(cut.vertices) - images[with_image], axis=1)
    of_corner = columns(attribute)[rows_of_corners(giver, attribute)]
    values = np.full((len(polygon), of_corner.shape[1]), np.nan)
    values[with_image] = places.interpolated(of_corner[corner_of_piece])
    return values, len(np.unique(polygon[with_image[miss_distance > ACROSS_SEAM_DISTANCE]]))


def _first_corners(asset: Asset, attribute: Attribute) -> IntArray:
    """Find the first corner (c,) at the same vertex with the same values."""
    values = columns(attribute)[rows_of_corners(asset, attribute)]
    none = np.finfo(np.float64).max  # replaces nan, which equals no number, not even itself
    return first_equal(np.column_stack([asset.vertex_of_corner, np.where(np.isnan(values), none, values)]))


def columns(attribute: Attribute) -> FloatArray:
    """Return the values of an attribute as floats (k, d)."""
    return attribute.values.reshape(len(attribute), -1).astype(np.float64)


def rows_of_corners(asset: Asset, attribute: Attribute) -> IntArray:
    """Return the row of an attribute at each corner of an asset, (c,)."""
    polygons = asset.polygons
    if attribute.domain == "point":
        return polygons.corners
    return polygons.of_corner if attribute.domain == "face" else np.arange(len(polygons.corners))


def _mesh_of_map(asset: Asset, n: int) -> tuple[Mesh, IntArray]:
    """Return the mesh with n vertices, welded or not, and their welded vertices."""
    if n == asset.mesh.n_vertices and n != len(asset.points):
        return asset.mesh, np.arange(n)
    return Mesh(asset.placed_points, asset.polygons.triangles), asset.vertex_of_point
