"""The picture of the house: which subpackages there are, and which imports which, drawn from the imports.

Run ``python docs/_extensions/house.py`` to draw ``docs/dev/images/house.svg`` again; a build does so, too.
"""

import ast
from html import escape
from itertools import pairwise
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "src" / "isomatch"
PICTURE = Path(__file__).parents[1] / "dev" / "images" / "house.svg"
WIDTH, HEIGHT, ROW, COLUMN = 176, 56, 104, 200
MARGIN = 16


def subpackage_of(module):
    """Subpackage of a module such as ``isomatch.surfaces.mesh``."""
    return module.split(".")[1]


def imports():
    """For each subpackage, the subpackages that its files import."""
    found = {}
    for file in sorted(PACKAGE.rglob("*.py*")):
        subpackage = file.relative_to(PACKAGE).parts[0]
        if file.suffix not in (".py", ".pyi") or not (PACKAGE / subpackage).is_dir():
            continue
        found.setdefault(subpackage, set())
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            modules = []
            if isinstance(node, ast.Import):
                modules = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module == "isomatch":
                modules = [f"isomatch.{alias.name}" for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                modules = [node.module]
            found[subpackage] |= {
                subpackage_of(module) for module in modules if module.startswith("isomatch.")
            }
    return {subpackage: (others & found.keys()) - {subpackage} for subpackage, others in found.items()}


def storeys(graph):
    """Storey of each subpackage: one above the highest subpackage that it imports."""
    level = {}
    while len(level) < len(graph):
        ready = [
            subpackage for subpackage in sorted(set(graph) - set(level)) if graph[subpackage] <= set(level)
        ]
        if not ready:
            raise ValueError(f"these subpackages import each other: {sorted(set(graph) - set(level))}")
        for subpackage in ready:
            level[subpackage] = 1 + max((level[other] for other in graph[subpackage]), default=-1)
    return level


def necessary(graph):
    """Leave out imports that follow from others: a subpackage reaches those through what it imports anyway."""
    below = {}
    for subpackage in sorted(graph, key=storeys(graph).get):
        below[subpackage] = graph[subpackage].union(*(below[other] for other in graph[subpackage]))
    return {
        subpackage: {other for other in others if not any(other in below[third] for third in others)}
        for subpackage, others in graph.items()
    }


def idea(subpackage):
    """First words of the docstring of a subpackage."""
    text = ast.get_docstring(ast.parse((PACKAGE / subpackage / "__init__.py").read_text(encoding="utf-8")))
    return text.splitlines()[0].split(":")[0].rstrip(".")


def lanes(graph):
    """Rows from the ground up: subpackages, and pairs (upper, lower), the lanes of imports that skip storeys."""
    level = storeys(graph)
    rows = [[] for _ in range(1 + max(level.values()))]
    for subpackage in sorted(graph):
        rows[level[subpackage]].append(subpackage)
    chains = []
    for upper, others in sorted(necessary(graph).items()):
        for lower in sorted(others):
            lane = [(upper, lower)] * (level[upper] - level[lower] - 1)
            for storey in range(level[lower] + 1, level[upper]):
                rows[storey].append((upper, lower))
            chains.append([upper, *lane, lower])
    links = {}
    for upper, *between, lower in chains:
        whole = [upper, *between, lower]
        for k, (above, below) in enumerate(pairwise(whole)):
            storey = level[upper] - k
            links.setdefault((storey, above), []).append((storey - 1, below))
            links.setdefault((storey - 1, below), []).append((storey, above))
    return _uncrossed(rows, links), chains, level


def _uncrossed(rows, links):
    """Sort each row by the mean place of what it is linked to, upwards and downwards in turn."""
    place = {}
    for storey, row in enumerate(rows):
        _number(row, storey, place)
    for sweep in range(12):
        for storey in range(len(rows)) if sweep % 2 else reversed(range(len(rows))):
            linked = {each: [place[link] for link in links.get((storey, each), [])] for each in rows[storey]}
            rows[storey].sort(key=lambda each: sum(linked[each]) / len(linked[each]))
            _number(rows[storey], storey, place)
    return rows


def _number(row, storey, place):
    for k, each in enumerate(row):
        place[storey, each] = k - (len(row) - 1) / 2


def drawing(graph):
    """Draw the subpackages as boxes in SVG, each above the subpackages that it imports."""
    rows, chains, level = lanes(graph)

    def width(each):
        return COLUMN if isinstance(each, str) else 36

    total = max(sum(map(width, row)) for row in rows) + 2 * MARGIN
    top = len(rows) - 1
    x, height = {}, len(rows) * ROW - (ROW - HEIGHT) + 2 * MARGIN
    for storey, row in enumerate(rows):
        left = (total - sum(map(width, row))) / 2
        for each in row:
            x[storey, each] = left + width(each) / 2
            left += width(each)

    def y(storey):
        return MARGIN + (top - storey) * ROW

    body = []
    for upper, *between, lower in chains:
        storey, steps = level[upper], [*between, lower]
        path = f"M{x[storey, upper]:.0f} {y(storey) + HEIGHT}"
        for each in steps:
            above, below = y(storey) + HEIGHT, y(storey - 1)
            start = x[
                storey, upper if storey == level[upper] else each if each in between else (upper, lower)
            ]
            end, middle = x[storey - 1, each], (above + below) / 2
            path += f"C{start:.0f} {middle:.0f} {end:.0f} {middle:.0f} {end:.0f} {below}"
            if each in between:
                path += f"V{below + HEIGHT}"
            storey -= 1
        body.append(f'<path d="{path}"/>')
    for storey, row in enumerate(rows):
        for subpackage in row:
            if isinstance(subpackage, str):
                left = x[storey, subpackage] - WIDTH / 2
                body.append(
                    f'<g><title>{escape(idea(subpackage))}</title><rect x="{left:.0f}" y="{y(storey)}" width="{WIDTH}" '
                    f'height="{HEIGHT}" rx="6"/><text x="{left + WIDTH / 2:.0f}" y="{y(storey) + HEIGHT / 2 + 6:.0f}">'
                    f"{subpackage}</text></g>"
                )
    style = (
        "rect{fill:#eef3f8;stroke:#40698c}text{font:17px system-ui,sans-serif;text-anchor:middle;fill:#16303f}"
        "path{fill:none;stroke:#8aa3b5;stroke-width:2}"
    )
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {total:.0f} {height}" width="{total:.0f}">',
        f'<style>{style}</style><rect width="{total:.0f}" height="{height}" style="fill:#fff;stroke:none"/>',
        *body,
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def draw(app=None):
    """Write the picture if it has changed."""
    text = drawing(imports())
    if not PICTURE.exists() or PICTURE.read_text(encoding="utf-8") != text:
        PICTURE.write_text(text, encoding="utf-8")


def setup(app):
    """Draw the house before a build."""
    app.connect("builder-inited", draw)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


if __name__ == "__main__":
    draw()
