"""Show in the gallery what examples write: pictures as pictures, pages as live scenes."""

from pathlib import Path
from shutil import copytree, ignore_patterns, move

from sphinx_gallery.scrapers import figure_rst

DOCS = Path(__file__).parents[1]
EXAMPLES = DOCS / "_build" / "examples"
SITE = DOCS / "_build" / "extra"
SCENE = """
.. raw:: html

    <iframe class="scene" src="{up}scenes/{name}" title="{title}" loading="lazy"></iframe>
    <p><a href="{up}scenes/{name}">Open it on a page of its own.</a></p>
"""


def copy_examples():
    """Copy the examples to where they are run, so that what they write is not left beside them."""
    copytree(DOCS.parent / "examples", EXAMPLES, dirs_exist_ok=True, ignore=ignore_patterns("__pycache__"))
    (SITE / "scenes").mkdir(parents=True, exist_ok=True)


def files_scraper(block, block_vars, gallery_conf):
    """Take the files that an example has written since the last block."""
    script = Path(block_vars["src_file"])
    scenes = []
    written = sorted(script.parent.glob("*.png"), key=lambda file: file.stat().st_mtime_ns)
    pictures = [move(file, next(block_vars["image_path_iterator"])) for file in written]
    depth = len(Path(block_vars["target_file"]).parent.relative_to(gallery_conf["src_dir"]).parts)
    for file in sorted(script.parent.glob("*.html")):
        move(file, SITE / "scenes" / file.name)
        scenes += [SCENE.format(up="../" * depth, name=file.name, title=file.stem.replace("_", " "))]
    return figure_rst(pictures, gallery_conf["src_dir"]) + "".join(scenes)
