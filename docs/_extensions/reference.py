"""The reference of the subpackages: a page for each, made from its public names, and links by bare names."""

import ast
import importlib
import inspect
import re
from pathlib import Path
from textwrap import indent

from docutils.nodes import literal

import isomatch

PACKAGE = Path(isomatch.__file__).parent
# such as cohort.shape_statistics, which comes before the subpackage that it is in
SUBPACKAGES = sorted(
    (".".join(stub.parent.relative_to(PACKAGE).parts) for stub in PACKAGE.glob("*/**/__init__.pyi")),
    reverse=True,
)


def homes():
    """Where each public name is documented: in ``isomatch`` if it is there, else in the first subpackage that has it."""
    found = dict.fromkeys(isomatch.__all__, "isomatch")
    for subpackage in sorted(SUBPACKAGES, key=_is_borrowed_by):
        module = importlib.import_module(f"isomatch.{subpackage}")
        for name in module.__all__:
            if not inspect.ismodule(getattr(module, name)):
                found.setdefault(name, module.__name__)
    return found


def home_of(module, name, home):
    """Where a name of a subpackage is documented: there, if that of the same name elsewhere is another thing."""
    same = getattr(importlib.import_module(home[name]), name) is getattr(module, name)
    return home[name] if same else module.__name__


def _is_borrowed_by(subpackage):
    """Sort subpackages so that one comes before those that pass its names on."""
    stub = PACKAGE.joinpath(*subpackage.split("."), "__init__.pyi").read_text(encoding="utf-8")
    return sum(f"from isomatch.{other}" in stub for other in SUBPACKAGES if other != subpackage)


def is_plain(value):
    """Whether a public name is a value or a type alias, not a class or a function."""
    return not (inspect.isclass(value) or inspect.isroutine(value))


def described(module, name):
    """Return the text below an assignment in the file that the stub takes a name from."""
    stub = ast.parse(Path(module.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    source = next(
        node.module
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for a in node.names
        if a.name == name
    )
    text = Path(importlib.util.find_spec(source).origin)
    body = ast.parse(text.read_text(encoding="utf-8")).body
    for statement, after in zip(body, [*body[1:], ast.Pass()]):
        targets = getattr(statement, "targets", [getattr(statement, "target", None)])
        if any(getattr(target, "id", None) == name for target in targets):
            if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
                return str(after.value.value)
            break
    return ""


def page(subpackage, home):
    """Write the page of a subpackage in reStructuredText."""
    module = importlib.import_module(f"isomatch.{subpackage}")
    title = f"isomatch.{subpackage}"
    described_in = {name: home_of(module, name, home) for name in module.__all__ if name in home}
    own = [name for name, place in described_in.items() if place == title]
    plain = [name for name in own if is_plain(getattr(module, name))]
    listed = [name for name in own if name not in plain]
    borrowed = [name for name, place in described_in.items() if place != title]
    directive = [
        f".. module:: {title}",
        *["   :no-index:"] * (subpackage in isomatch.__all__),
    ]
    lines = [title, "=" * len(title), "", *directive, "", inspect.getdoc(module) or "", ""]
    if listed:
        lines += [".. autosummary::", "   :toctree: names", "   :nosignatures:", ""]
        lines += [*(f"   {name}" for name in listed), ""]
    for name in plain:
        value = repr(getattr(module, name)).replace("isomatch.", "").replace("\n", " ")
        lines += [f".. py:data:: {name}", f"   :value: {value if len(value) < 100 else '…'}", ""]
        lines += [indent(described(module, name), "   "), ""]
    if borrowed:
        links = ", ".join(f":py:obj:`~{described_in[name]}.{name}`" for name in borrowed)
        lines += [f"Also here, and described elsewhere: {links}.", ""]
    return "\n".join(lines)


def write_subpackages(app, config):
    """Write the pages before the summaries are generated."""
    folder = Path(app.srcdir) / "reference" / "subpackages"
    folder.mkdir(exist_ok=True)
    home = homes()
    for subpackage in SUBPACKAGES:
        path, text = folder / f"{subpackage}.rst", page(subpackage, home)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
    modules = [importlib.import_module(f"isomatch.{subpackage}") for subpackage in SUBPACKAGES]
    current = {
        f"{home_of(each, name, home)}.{name}" for each in modules for name in each.__all__ if name in home
    }
    current |= {f"isomatch.{name}" for name in isomatch.__all__}
    for stale in Path(app.srcdir, "reference").rglob("names/*.rst"):
        if stale.stem not in current:
            stale.unlink()


def find_home(app, env, node, contnode):
    """Resolve a name without its subpackage, such as `match`, and leave names that are no public ones as code."""
    if node.get("refdomain") != "py":
        return None
    name = node["reftarget"].removeprefix("isomatch.")
    for subpackage in SUBPACKAGES:
        name = name.removeprefix(f"{subpackage}.")
    first, _, rest = name.partition(".")
    home = homes_of_site.get(first)
    if home is None:
        return None
    full = ".".join(filter(None, [home, first, rest]))
    domain = env.get_domain("py")
    if full not in domain.objects:
        full = f"{home}.{first}"
    if full not in domain.objects:
        return None
    return domain.resolve_xref(
        env, node["refdoc"], app.builder, "obj", full, node, literal("", contnode.astext())
    )


def shortened(app, what, name, obj, options, signature, returns):
    """Leave out the defaults of nested settings, which have pages of their own."""
    if signature:
        signature = re.sub(r"(\w+Settings)\((?:[^()]|\([^()]*\))*\)", r"\1()", signature)
    return signature, returns


homes_of_site = homes()


def setup(app):
    """Write pages before files are listed, so that their summaries are made, too."""
    app.connect("config-inited", write_subpackages)
    app.connect("missing-reference", find_home)
    app.connect("autodoc-process-signature", shortened)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
