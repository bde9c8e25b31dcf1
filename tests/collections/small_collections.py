"""How tests run small collections and compare their maps."""

from concurrent.futures import ThreadPoolExecutor

from isomatch.collections import PairMaps

N = (260, 270, 280, 290)  # vertices of the shapes


def run(collection, **options):
    """Run a collection in this process; its events."""
    with ThreadPoolExecutor(1) as executor:
        return list(collection.run(executor, 1, **options))


def arrays_of(folder):
    """Bytes of all maps, by the names of their files."""
    found = {path.name: PairMaps.load(path) for path in (folder / "maps").iterdir()}
    return {
        name: b"".join(
            part.tobytes()
            for side in (maps.there, maps.back)
            for part in (side.vertices, side.faces, side.barycentric)
        )
        for name, maps in found.items()
    }
