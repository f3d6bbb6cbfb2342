"""Sphinx's settings of dhkit's site; `make docs` builds it, and a warning is an error."""

from __future__ import annotations

import ast
import importlib
import re
import sys
from pathlib import Path
from types import UnionType
from typing import Annotated, Union, get_args, get_origin

import numpy as np
from docutils import nodes
from numpy.typing import ArrayLike
from sphinx import addnodes
from sphinx.ext import autosummary
from sphinx.ext.napoleon.docstring import NumpyDocstring
from sphinx.transforms.post_transforms import SphinxPostTransform
from sphinx.util import inspect as sphinx_inspect, typing as sphinx_typing

import dhkit
from dhkit.cached_property import cached_property

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
from make_reference import existing_packages, exported, home_places  # noqa: E402

project = "dhkit"
author = "The dhkit developers"
version = release = dhkit.__version__
copyright = "The dhkit developers"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
]
exclude_patterns = ["_build", "_generated", "examples", "llms.md"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
nitpicky = True

# Pages: MyST Markdown, which GitHub renders too.
myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
myst_links_external_new_tab = False

# Mathematics: a vendored MathJax draws it, and asks for no network. The packages that load others are left out.
mathjax_path = "mathjax/tex-svg.js"
mathjax3_config = {
    "tex": {"packages": {"[-]": ["autoload", "require"]}},
    "options": {"enableMenu": False},
    "svg": {"fontCache": "global"},
}

# The reference: from docstrings, whose types are the signatures'.
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
autoclass_content = "class"
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_attr_annotations = False
autosummary_generate = False

copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
copybutton_only_copy_prompt_lines = True

html_theme = "furo"
html_title = "dhkit"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_extra_path = ["_generated/extra"]
html_show_sphinx = False
html_copy_source = False
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#1c4e9c", "color-brand-content": "#1c4e9c"},
    "dark_css_variables": {"color-brand-primary": "#8fb6ff", "color-brand-content": "#8fb6ff"},
    "navigation_with_keys": True,
}
# Of the light styles, one whose comments and outputs have a contrast of 4.5 or more.
pygments_style = "default"
pygments_dark_style = "github-dark"


def is_property(value: object) -> bool:
    """Return whether a member is a property: dhkit has a cached one of its own."""
    return _IS_PROPERTY(value) or isinstance(value, cached_property)


_IS_PROPERTY = sphinx_inspect.isproperty
sphinx_inspect.isproperty = is_property


# A section of attributes is a list of names, several of which may share a line, without references.
# The first line of an attribute's docstring is a sentence, and what stands before its colon is not a type.
NumpyDocstring._parse_attributes_section = lambda self, section: self._format_fields(
    "Attributes", self._consume_fields(prefer_type=False)
)
# Sections after it, such as Raises, are read as those of a method.
NumpyDocstring._parse_attribute_docstring = lambda self: NumpyDocstring(
    self._dedent(self._consume_to_end()), self._config, self._app, "method"
).lines()

# A sentence ends at a period after a word and before a capital: not at "A_1 ... A_n", nor at the dot of a product.
autosummary.periods_re = re.compile(r"(?<=[^\s.])\.\s+(?=[A-Z`*(:])")


def homes() -> dict[str, str]:
    """Return where a public name is documented, by every path under which dhkit exports it."""
    found: dict[str, str] = {"dhkit.arm.Arm": "dhkit.Arm"}
    places = home_places()
    for package in existing_packages():
        module = importlib.import_module(f"dhkit.{package}")
        for name in exported(module):
            home = places[package, name]
            found[f"dhkit.{package}.{name}"] = home
            found[f"dhkit.{name}"] = home
            source = getattr(getattr(module, name), "__module__", None)
            if isinstance(source, str):
                found[f"{source}.{name}"] = home
    return found


def defined_names() -> set[str]:
    """Return every name that dhkit's sources define, modules included, documented here or not."""
    names = set()
    for path in Path(dhkit.__file__).parent.rglob("*.py"):
        names.add(path.parent.name if path.stem == "__init__" else path.stem)
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                names.add(node.name)
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                names.add(node.id)
    return names


class FullNames(SphinxPostTransform):
    """Give references to Python names the path under which the name is documented, before they are resolved."""

    default_priority = 5

    def run(self, **kwargs) -> None:
        """Change the targets of a page's references."""
        domain = self.env.get_domain("py")
        for node in self.document.findall(addnodes.pending_xref):
            if node.get("refdomain") == "py":
                target = node["reftarget"].lstrip(".~")
                if full := full_name(self.env, node, target, domain.objects):
                    node["reftarget"] = full
                # An ambiguous short name is not looked up in every class: Sphinx does so where this key exists.
                node.attributes.pop("refspecific", None)


NUMBER = re.compile(r"-?\d[\d.,]*(e[-+]?\d+)?( (%|s|ms|µs|ns))?")
"""The text of a cell that holds a number, with or without its unit."""


class NumbersAtTheRight(SphinxPostTransform):
    """Mark the cells of a table's columns of numbers, which the style sheet aligns and does not divide."""

    default_priority = 6

    def run(self, **kwargs) -> None:
        """Look at each column of each table; cells that span others have no columns."""
        for table in self.document.findall(nodes.table):
            rows = [list(row.findall(nodes.entry)) for row in table.findall(nodes.row)]
            if len({len(row) for row in rows}) != 1:
                continue
            for column in zip(*rows, strict=True):
                bodies = [cell for cell in column if isinstance(cell.parent.parent, nodes.tbody)]
                filled = [text for cell in bodies if (text := cell.astext().strip())]
                numbers = [text for text in filled if NUMBER.fullmatch(text)]
                words = [text for text in filled if text.isalpha()]
                if numbers and len(numbers) + len(words) == len(filled):
                    for cell in column:
                        cell["classes"].append("number")


LONGEST_WORD = 36
"""Longest word of inline code that fits on a line of a telephone, characters."""


class LongWords(SphinxPostTransform):
    """Mark inline code that has a word too long for a narrow screen: the style sheet divides no other.

    Its text is cut after dots and slashes: each piece becomes an element, before which a line may end.
    """

    default_priority = 7

    def run(self, **kwargs) -> None:
        """Look at every piece of inline code."""
        for literal in self.document.findall(nodes.literal):
            if max(map(len, literal.astext().split()), default=0) > LONGEST_WORD:
                literal["classes"].append("long")
                for text in list(literal.findall(nodes.Text)):
                    pieces = re.split(r"(?<=[./])(?=\w)", text)
                    text.parent.replace(text, [nodes.Text(piece) for piece in pieces])


def full_name(env, node, target: str, objects) -> str | None:
    """Return the documented name that a reference means: of its class, its module, dhkit, or the only such one."""
    module = node.get("py:module") or ""
    owner = node.get("py:class") or ""
    for name in (
        f"{module}.{owner}.{target}",
        f"{owner}.{target}",
        f"{module}.{target}",
        target,
        env.homes.get(target, ""),
        env.homes.get(f"{module}.{target}", ""),
        env.homes.get(f"dhkit.{target}", ""),
    ):
        if name in objects and not objects[name].aliased:
            return name
    suffix = f".{target}"
    found = {env.homes.get(name, name) for name in objects if name.endswith(suffix)}
    found = {name for name in found if name in objects and not objects[name].aliased}
    return found.pop() if len(found) == 1 else None


def without_page(app, env, node, content):
    """Leave a name without a page as text: types of other libraries, and names of dhkit's own sources.

    A role that names nothing that is defined anywhere stays unresolved, which is a warning.
    """
    if node.get("refdomain") != "py":
        return None
    target = node["reftarget"].lstrip(".~")
    is_annotation = any(isinstance(one, addnodes.desc_signature) for one in ancestors(node))
    is_foreign = target.split(".")[0] in {
        "numpy",
        "enum",
        "collections",
        "typing",
        "pathlib",
        "fractions",
    }
    is_defined = target.rsplit(".", 1)[-1] in env.defined
    return content if is_annotation or is_foreign or is_defined else None


def ancestors(node):
    """Yield the elements around a node."""
    while node is not None:
        yield node
        node = node.parent


def prepare(app, env):
    """Index the names once, before references are resolved."""
    env.homes = homes()
    env.defined = defined_names()


OUTSIDE = {"ARCHITECTURE.md": "architecture.md"}
"""Files beside docs/ that the site includes, and their pages."""


OPTIONAL = ("report", "install", "stability", "reference/report")
"""Pages that a checkout may lack."""


def with_own_pages(app, name: str, source: list[str]) -> None:
    """Lead links to included files to their pages: GitHub has the files, the site the pages."""
    depth = "../" * name.count("/")
    for page in OPTIONAL:
        if not any((HERE / f"{page}{suffix}").exists() for suffix in (".md", ".rst")):
            path = (
                page.removeprefix("reference/") if name.startswith("reference/") else f"../{page}"
            )
            source[0] = source[0].replace(f"\n{path}\n", "\n")
    # A doctest needs an empty line after its last output; a reader does not.
    source[0] = source[0].replace("\n\n```\n", "\n```\n")
    for file, page in OUTSIDE.items():
        source[0] = source[0].replace(f"](../{depth}{file})", f"]({depth}{page})")


def with_own_links(app, name: str, parent: str, content: list[str]) -> None:
    """Lead links inside an included file, which are relative to its own folder, to pages of the site."""
    if str(parent) == "architecture":
        content[0] = content[0].replace("](docs/", "](")


UNIONS = {"ArrayLike": set(get_args(ArrayLike)), "Robot": set(get_args(dhkit.description.Robot))}
"""Unions that the sources name, with their members, which Python evaluates to one flat union."""
_TYPE_TEXT = sphinx_typing.stringify_annotation
_VALUE_TEXT = sphinx_inspect.object_description


def type_text(annotation, mode="fully-qualified-except-typing", **options) -> str:
    """Return a type as the sources write it: the alias, instead of what it stands for."""
    if isinstance(annotation, str) and annotation.startswith("Annotated["):
        return without_metadata(annotation)
    members = list(get_args(annotation))
    origin = get_origin(annotation)
    if origin is Annotated:
        return type_text(members[0], mode, **options)
    if origin is np.ndarray and len(members) == 2 and get_args(members[1]):
        entry = get_args(members[1])[0]
        name = getattr(entry, "__name__", str(entry))
        return "Array" if entry is np.float64 else f"NDArray[{name}]"
    if origin in (Union, UnionType):
        names = []
        for name, union in UNIONS.items():
            if union and union <= set(members):
                names.append(name)
                members = [member for member in members if member not in union]
        if names:
            return " | ".join([*names, *(type_text(member, mode, **options) for member in members)])
    return _TYPE_TEXT(annotation, mode, **options)


def without_metadata(annotation: str) -> str:
    """Return the type of an ``Annotated[type, ...]`` that is given as text."""
    tree = ast.parse(annotation, mode="eval").body
    return ast.unparse(tree.slice.elts[0])


def value_text(value, **options) -> str:
    """Return a default as it is written: that of a field of pydantic is what its factory makes."""
    factory = getattr(value, "default_factory", None)
    if type(value).__name__ == "FieldInfo" and factory is not None:
        value = factory()
    return _VALUE_TEXT(value, **options)


def default_text(value, **options) -> str:
    """Return the default of a parameter; an ellipsis, as in stubs, for an object that does not print as Python.

    Sphinx divides a signature that is not Python at its commas, those inside types and values included.
    """
    text = value_text(value, **options)
    try:
        ast.parse(text, mode="eval")
    except SyntaxError:
        return "..."
    return text


def without_signature_of_protocols(app, what: str, name: str, value, options, signature, returns):
    """Leave out the signature of a protocol's constructor, (*args, **kwargs), which nobody calls."""
    is_protocol = what == "class" and getattr(value, "_is_protocol", False)
    return ("", None) if is_protocol else None


def replace_in_sphinx(old, new) -> None:
    """Replace a function wherever a module of Sphinx has it by name."""
    for name, module in list(sys.modules.items()):
        if name.startswith("sphinx"):
            for key, value in list(vars(module).items()):
                if value is old:
                    setattr(module, key, new)


def setup(app):
    """Register the resolution of names."""
    replace_in_sphinx(_TYPE_TEXT, type_text)
    replace_in_sphinx(_VALUE_TEXT, value_text)
    # The name that signatures are written with; values of attributes are shown as they print.
    sphinx_inspect.object_description = default_text
    app.connect("source-read", with_own_pages)
    app.connect("include-read", with_own_links)
    app.connect("env-check-consistency", prepare)
    app.connect("missing-reference", without_page)
    app.connect("autodoc-process-signature", without_signature_of_protocols)
    app.add_post_transform(FullNames)
    app.add_post_transform(NumbersAtTheRight)
    app.add_post_transform(LongWords)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
