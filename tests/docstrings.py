"""What is wrong with docstrings: numpydoc's sections against signatures and source.

- Sections come in numpydoc's order.
- Under Parameters (and Attributes, of classes) stand the names of the signature, all of them and
  in its order, unless the text refers to another's ("see `relight`", "`relight` as a generator").
- A docstring without Parameters names each parameter in its text.
- What hands something out says what: under Returns or Yields, by "returns", or as a phrase that is
  a thing and not an order ("The `Scene` of ...", "(n, 3) float64 of ...").
- Types that are arrays carry a shape.
"""

import ast
import importlib
import inspect
import pkgutil
import re
import textwrap
from functools import cached_property

ORDER = ["Parameters", "Attributes", "Returns", "Yields", "Raises", "Warns", "See Also", "Notes"]
ARRAY = re.compile(r"\b(u?int(8|16|32|64)|float(16|32|64)|arrays?|CSR)\b")
# A shape is in brackets, with a comma or dots: (n_points, 3), (n,), (...).
SHAPE = re.compile(r"\([^()]*(,|\.\.\.)|same shape|\bdict of ")
OTHERS = re.compile(r"^`|\b([Ss]ee|[Aa]s|Undoes|Undo) `")
ORDERS = re.compile(
    r"(Add|Ask|Bake|Build|Find|Make|Open|Put|Raise|Read|Remove|Set|Take|Trace|Write)\b"
)
# What needs a module that is not there everywhere is asked for by its own name.
BLENDER = "prt_core.blender"


def modules(package, packages_only=False):
    """A package and what is within it, but for Blender's side."""
    yield package
    for info in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        main = info.name.endswith("__main__")
        if not main and not info.name.startswith(BLENDER) and (info.ispkg or not packages_only):
            yield importlib.import_module(info.name)


def exported(package):
    """{dotted name: function or class} of all that a package and its folders list in `__all__`."""
    result = {}
    for module in modules(package, packages_only=True):
        for name in getattr(module, "__all__", ()):
            thing = getattr(module, name)
            if _documented(thing) and thing.__module__.startswith(package.__name__):
                # Under its own module: what two folders export is looked at once.
                result[f"{thing.__module__}.{thing.__qualname__}"] = thing
    return result


def public(module):
    """{dotted name: function or class} that a module itself makes and does not hide."""
    return {
        f"{module.__name__}.{name}": thing
        for name, thing in vars(module).items()
        if name[0] != "_" and _documented(thing) and thing.__module__ == module.__name__
    }


def _documented(thing):
    return inspect.isfunction(thing) or inspect.isclass(thing)


def faults(name, thing, all_named=True):
    """What is wrong with the docstrings of a function, or of a class and its public methods.

    Parameters
    ----------
    name : str
        For messages.
    thing : function or class
    all_named : bool
        Whether docstrings without Parameters must name every parameter.
    """
    if inspect.isfunction(thing):
        yield from Docstring(name, thing.__doc__, all_named).faults_of_function(thing)
        return
    yield from Docstring(name, thing.__doc__, all_named).faults_of_class(thing)
    for key, value in vars(thing).items():
        method = value.__func__ if isinstance(value, classmethod | staticmethod) else value
        if key[0] == "_":
            continue
        # Fields of dataclasses may hold functions: these are not methods.
        if inspect.isfunction(method) and method.__qualname__.startswith(thing.__qualname__):
            # A method that has no text takes that of the class above, which is checked there.
            text = inspect.getdoc(getattr(thing, key))
            if method.__doc__ is not None or text is None:
                yield from Docstring(f"{name}.{key}", text, all_named).faults_of_function(method)
        elif isinstance(value, property) and inspect.getdoc(value) is None:
            yield f"{name}.{key}: has no docstring"


class Docstring:
    """A docstring in sections.

    Parameters
    ----------
    name : str
    text : str or None
    all_named : bool
    """

    def __init__(self, name, text, all_named=True):
        self.name, self.all_named = name, all_named
        self.text = inspect.cleandoc(text) if text else ""

    @cached_property
    def sections(self):
        """{title: text}; what comes before the first title is under ''."""
        parts = re.split(r"^([A-Z][A-Za-z ]*)\n-{3,}$", self.text, flags=re.MULTILINE)
        return {"": parts[0], **dict(zip(parts[1::2], parts[2::2], strict=True))}

    def entries(self, *titles):
        """(names, type) of each entry of some sections; all is names where there is no type."""
        for title in titles:
            for line in self.sections.get(title, "").splitlines():
                if line.strip() and not line.startswith((" ", "Source:")):
                    names, _, kind = line.partition(" : ")
                    yield [part.strip().lstrip("*") for part in names.split(",")], kind

    def faults_of_function(self, function):
        """Of a function or method."""
        signature = inspect.signature(function)
        wanted = [name for name in signature.parameters if name not in ("self", "cls")]
        yield from self._faults(wanted, ["Parameters"])
        if self.text and _hands_out(function) and not self._says_what_it_hands_out():
            yield f"{self.name}: does not say what it returns"

    def faults_of_class(self, kind):
        """Of a class: what its `__init__` takes is documented with it."""
        wanted = []
        if "__init__" in vars(kind) and not getattr(kind, "_is_protocol", False):
            wanted = [name for name in inspect.signature(kind).parameters if name[0] != "_"]
        yield from self._faults(wanted, ["Parameters", "Attributes"])

    def _faults(self, wanted, titles):
        if not self.text:
            yield f"{self.name}: has no docstring"
            return
        known = [title for title in self.sections if title]
        strange = [title for title in known if title not in ORDER]
        if strange:
            yield f"{self.name}: there is no section {', '.join(strange)}"
        elif known != sorted(known, key=ORDER.index):
            yield f"{self.name}: sections are in the order {', '.join(known)}"
        if any(title in self.sections for title in titles):
            yield from self._faults_of_names(wanted, titles)
        elif self.all_named and not OTHERS.search(self.text):
            words = set(re.findall(r"\w+", self.text))
            missing = [name for name in wanted if name not in words]
            if missing:
                yield f"{self.name}: says nothing of {', '.join(missing)}"
        for names, kind in self.entries("Parameters", "Attributes", "Returns", "Yields"):
            kind = kind or ", ".join(names)
            if ARRAY.search(kind) and not SHAPE.search(kind):
                yield f"{self.name}: {', '.join(names)} is an array without a shape"

    def _faults_of_names(self, wanted, titles):
        named = [name for names, _ in self.entries("Parameters") for name in names]
        for names, _ in self.entries(*titles[1:]):
            # Attributes may be more than what a class takes, and say what it takes as well.
            named += [name for name in names if name in wanted and name not in named]
        refers = OTHERS.search(self.sections[""]) and set(named) < set(wanted)
        if named != wanted and not refers:
            yield f"{self.name}: documents ({', '.join(named)}), takes ({', '.join(wanted)})"

    def _says_what_it_hands_out(self):
        first = self.text.partition("\n\n")[0]
        return (
            re.search(r"^Returns|^Yields|\breturns\b", self.text, re.MULTILINE)
            or OTHERS.search(self.text)
            or SHAPE.search(first)
            or not ORDERS.match(first)
        )


def _hands_out(function):
    """Whether a function's own statements return something."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    return any(isinstance(node, ast.Return) and not _is_none(node.value) for node in _own(tree))


def _is_none(value):
    return value is None or isinstance(value, ast.Constant) and value.value is None


def _own(node):
    """All nodes of a function but those of functions inside it."""
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.FunctionDef | ast.Lambda | ast.ClassDef):
            yield child
            yield from _own(child)
