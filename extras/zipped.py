"""Zip the add-on for Blender and the module for 3D Slicer: ``python extras/zipped.py FOLDER [--wheels FOLDER]``.

With a folder of wheels, as ``pip download`` or ``pip wheel`` makes it, the add-on brings its packages along.
"""

import argparse
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

HERE = Path(__file__).parent
PACKAGES = {"isomatch_blender": HERE / "blender" / "isomatch_blender", "IsomatchSlicer": HERE / "slicer"}
LEFT_OUT = {"__pycache__"}


def zipped(name: str, output: Path, wheels: Path | None = None) -> Path:
    """Write ``NAME.zip`` with one folder of that name, and the wheels in the manifest of the add-on; return its path."""
    folder, file = PACKAGES[name], output / f"{name}.zip"
    added = sorted(wheels.glob("*.whl")) if wheels else []
    with ZipFile(file, "w", ZIP_DEFLATED) as archive:
        for path in sorted(folder.rglob("*")):
            if not path.is_file() or LEFT_OUT & set(path.parts):
                continue
            text = path.read_bytes()
            if added and path.name == "blender_manifest.toml":
                listed = "".join(f'  "./wheels/{wheel.name}",\n' for wheel in added)
                head, tail = text.decode().split("\n[permissions]")
                text = f"{head}\nwheels = [\n{listed}]\n\n[permissions]{tail}".encode()
            archive.writestr(f"{name}/{path.relative_to(folder).as_posix()}", text)
        archive.write(HERE.parent / "LICENSE", f"{name}/LICENSE.txt")
        for wheel in added:
            archive.write(wheel, f"{name}/wheels/{wheel.name}")
    return file


def main() -> None:
    """Write both zips."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("output", type=Path)
    parser.add_argument("--wheels", type=Path, help="folder of wheels for the add-on")
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    for name in PACKAGES:
        wheels = given.wheels if name == "isomatch_blender" else None
        print(zipped(name, given.output, wheels))  # noqa: T201


if __name__ == "__main__":
    main()
