"""The pictures of ``docs/wishes`` and the moving picture of the readme, of shapes that isomatch makes.

Run ``python docs/images/draw_wishes.py`` to draw them again; it takes two minutes, and needs the extra ``creatures``,
playwright and Chromium.
"""

from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib import colormaps
from PIL import Image
from playwright.sync_api import sync_playwright
from scipy.spatial.transform import Rotation

from isomatch import (
    Landmarks,
    Mesh,
    carry_attributes,
    distance_basis,
    geodesic_distances,
    match,
    write_landmarks,
    write_mesh,
)
from isomatch.cohort import Collection, finish, write_landmark_tables
from isomatch.cohort.shape_statistics import ShapeModel, read_shapes
from isomatch.datasets import animal_head, example_pair
from isomatch.geodesics import distance_engine, farthest_point_sampling
from isomatch.io import looks_of, pixels_of, sample_texture
from isomatch.visualization import arranged_panels, camera_of, position_colours, surface_image
from isomatch_lab.procedural import creature, organ

HERE = Path(__file__).parent
N_BANDS = 14  # of a distance
GREY = np.full(3, 0.82)
FRAMES, WAIT = 24, 8  # of the way there, and of the rest at either end
MOST_BYTES = 1_500_000


def saved(name, images, titles, per_row=None, dpi=130):
    """Save pictures in a row."""
    figure, _ = arranged_panels(images, titles, per_row or len(images))
    figure.savefig(HERE / f"{name}.png", dpi=dpi, bbox_inches="tight", pad_inches=0.03)


def collected(folder, meshes):
    """Match meshes with the first of them."""
    for name, mesh in meshes.items():
        write_mesh(folder / f"scans/{name}.ply", mesh)
    collection = Collection.create(folder / "out", folder / "scans", template=next(iter(meshes)))
    for _ in collection.run():
        pass
    for _ in finish(collection):
        pass
    return collection


def landmarks(folder):
    """Landmarks of one animal on five others."""
    animals = {f"animal {i + 1}": creature(2500, style=i % 3, pose=i, triangulation=i).mesh for i in range(6)}
    collection = collected(folder, animals)
    first = next(iter(animals))
    mesh = animals[first]
    tips = farthest_point_sampling(distance_engine(mesh), 12, int(mesh.vertices[:, 1].argmax())).vertices
    write_landmarks(
        folder / "marks.mrk.json", Landmarks(mesh.vertices[tips], [f"L{i + 1}" for i in range(12)])
    )
    found = write_landmark_tables(collection.folder, folder / "marks.mrk.json", folder / "carried")
    with sync_playwright() as playwright:
        arguments = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"]
        browser = playwright.chromium.launch(executable_path=which("chromium"), args=arguments)
        page = browser.new_page(viewport={"width": 1000, "height": 640}, device_scale_factor=1.5)
        page.goto(Path(found.look_at).as_uri())
        page.locator("#stage").screenshot(path=HERE / "wish_landmarks.png")


def mean(folder):
    """Kidneys with their own triangles, their mean, and two standard deviations of the first mode."""
    kidneys = {f"kidney {i + 1}": organ("kidney", 1500, style=i, pose=i).mesh for i in range(4)}
    collected(folder, kidneys)
    model = ShapeModel.fit(read_shapes(folder / "out/corresponded"))
    minus, plus = (model.mode_mesh(0, side) for side in (-2.0, 2.0))
    aligned = zip(kidneys, (model.mesh().moved(vertices) for vertices in model.aligned))
    drawn = [*aligned, ("mean", model.mesh()), ("first mode, −2 sd", minus), ("first mode, +2 sd", plus)]
    camera = camera_of(model.mesh())
    images = [plain(mesh, camera) for _, mesh in drawn]
    saved("wish_mean", images, [name for name, _ in drawn])


def plain(mesh, camera=None):
    """A picture in grey."""
    return surface_image(mesh, np.zeros(mesh.n_vertices), lambda v: np.tile(GREY, (len(v), 1)), camera, 200)


def distances():
    """Distances from one vertex as bands, by fast marching and from fifty numbers a vertex."""
    mesh = example_pair()[0].mesh
    start = int(mesh.vertices[:, 1].argmax())
    exact, basis = geodesic_distances(mesh, [start])[0], distance_basis(mesh, k=50)

    def bands(seen):
        colours = colormaps["viridis"](np.clip(seen.ravel() / exact.max(), 0, 1))[:, :3]
        return np.where((seen.ravel() * N_BANDS / exact.max() % 1 < 0.15)[:, None], 0.35 * colours, colours)

    values = {"fast marching": exact, "from 50 numbers a vertex": basis.row(start)}
    saved("wish_distances", [surface_image(mesh, value, bands) for value in values.values()], list(values))


def keys():
    """The stripes and the shape keys of a cat, and what a lion gets of them by the map that is found."""
    cat = animal_head("cat", 6000).rigged()
    lion = animal_head("lion", 6000, triangulation=1).rigged(keys=False)
    lion = carry_attributes(match(lion.mesh, cat.mesh).map, lion, cat).asset
    layer = looks_of(cat).looks[0].base
    pixels = pixels_of(layer.picture.data)
    turn = Rotation.from_euler("y", 55, degrees=True).as_matrix()

    def striped(uv):
        return sample_texture(pixels, layer, uv)[:, :3]

    images = []
    for animal in (cat, lion):
        for key in (None, "jaw_open", "smile"):
            moves = animal.attribute(key).values if key else 0
            mesh = Mesh((animal.mesh.vertices + moves) @ turn.T, animal.mesh.faces)
            images.append(surface_image(mesh, animal.attribute("uv").values, striped, np.eye(3), 260))
    titles = ["cat", "its key jaw_open", "its key smile", "lion", "jaw_open, carried", "smile, carried"]
    saved("wish_keys", images, titles, 3, dpi=80)


def flow():
    """A map flowing from one body to the other: the standing animal in its topology becomes the running one."""
    standing, running = (animal.mesh for animal in example_pair())
    result = match(standing, running)
    there = result.as_mesh(standing, running).vertices
    there = there - there.mean(axis=0) + standing.vertices.mean(axis=0)
    colours = position_colours(standing)
    camera = camera_of(standing)
    steps = 0.5 - 0.5 * np.cos(np.pi * np.linspace(0, 1, FRAMES))
    way = np.concatenate([np.zeros(WAIT), steps, np.ones(WAIT), steps[::-1]])
    frames = [
        surface_image(
            Mesh((1 - t) * standing.vertices + t * there, standing.faces), colours, lambda v: v, camera, 520
        )
        for t in way
    ]
    height, width = np.max([frame.shape[:2] for frame in frames], axis=0)
    pictures = []
    for frame in frames:
        picture = Image.new("RGBA", (int(width), int(height)), (0, 0, 0, 0))
        picture.paste(
            Image.fromarray((255 * frame).astype(np.uint8)),
            ((width - frame.shape[1]) // 2, height - frame.shape[0]),
        )
        pictures.append(picture)
    path = HERE / "flow.webp"
    pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=50, loop=0, quality=70)
    assert path.stat().st_size < MOST_BYTES


if __name__ == "__main__":
    for each in (landmarks, mean):
        with TemporaryDirectory() as place:
            (Path(place) / "scans").mkdir()
            each(Path(place))
    distances()
    keys()
    flow()
