"""Who uses which name of the packages: every definition, and the first stage from which it is reached.

A name is used when an entry point reaches it: the console script, the pytest plugin, modules that are run
with ``python -m``, ``scripts/``. A use inside code out of reach counts for nothing, nor an import without a
use: re-exports are looked through. Registration counts: ``@app.command()`` makes `app` use the command. A
module that imports by string uses the names it spells, in modules it spells and in its ``__package__``.

This is read off the syntax, without importing anything. Only names at the top of modules are followed:
methods and fields are not, for which of them a call means depends on types.
"""

import ast
import re
import textwrap
import tomllib
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path

PACKAGES = ("perchhw", "calibration", "onboard", "mocap_bridge", "sim_backend")

STAGES: dict[str, tuple[str, ...]] = {
    "code": (*PACKAGES, "scripts"),
    "docs": (),
    "benchmarks": ("benchmarks",),
    "tests": ("tests",),
}
"""Who may use a name, first come first, and the folders of it. The code blocks of pages are "docs"."""

Key = tuple[str, str]
"""A module and a name at its top; without a name: the statements of the module that define nothing."""

_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
_SCOPES = (*_FUNCTIONS, ast.Lambda, ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
_CODE_OF_PAGE = re.compile(r"^```python\n([\s\S]*?)```|((?:^ {4}.*\n|^\n)+)", re.MULTILINE)


class Uses:
    """What code mentions.

    Attributes:
        names: dotted, as written, without what is local to a function.
        attributes: last parts of anything dotted.
        strings: texts.
    """

    def __init__(self) -> None:
        self.names, self.attributes, self.strings = set[str](), set[str](), set[str]()

    def add(self, node: ast.AST, local: frozenset[str] = frozenset()) -> None:
        """Collect from `node`, in a scope whose own variables are `local`."""
        if isinstance(node, _SCOPES):
            local |= _variables(node)
        if isinstance(node, ast.Attribute | ast.Name) and not isinstance(node.ctx, ast.Store):
            dotted = ast.unparse(node)
            if dotted.split(".")[0] not in local:
                self.names.add(dotted)
            if isinstance(node, ast.Attribute):
                self.attributes.add(node.attr)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            self.strings.add(node.value)
        for hint in (getattr(node, "annotation", None), getattr(node, "returns", None)):  # quoted types
            parts = ast.walk(hint) if isinstance(hint, ast.AST) else ()
            self.names |= {str(part.value) for part in parts if isinstance(part, ast.Constant)}
        for child in ast.iter_child_nodes(node):
            self.add(child, local)


def _variables(scope: ast.AST) -> frozenset[str]:
    """Arguments of a function or comprehension, and what it assigns."""
    inner = list(ast.walk(scope))
    names = {n.id for n in inner if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    names |= {n.arg for n in inner if isinstance(n, ast.arg)}
    return frozenset(names - {name for n in inner if isinstance(n, ast.Global) for name in n.names})


class Module:
    """A file, or a block of code on a page.

    Attributes:
        name, stage, path: where it is.
        ours: whether it belongs to the packages.
        definitions: statements by the name that they define at its top.
        uses: what these mention, by the same name; under "" what the other statements do.
        registered: first name of a decorator, and the function below it.
        imports: full dotted names by the names under which they are imported, anywhere in it.
    """

    def __init__(self, name: str, stage: str, path: Path, text: str) -> None:
        self.name, self.stage, self.path, tree = name, stage, path, ast.parse(text)
        self.ours = name.split(".")[0] in PACKAGES
        self.definitions = defaultdict[str, list[ast.stmt]](list)
        self.uses = defaultdict[str, Uses](Uses, {"": Uses()})
        self.registered = list[tuple[str, str]]()
        self.imports = dict[str, str]()
        for node in ast.walk(tree):
            origin = f"{node.module}." if isinstance(node, ast.ImportFrom) else ""
            for alias in node.names if isinstance(node, ast.Import | ast.ImportFrom) else ():
                bound = alias.asname or (alias.name if origin else alias.name.split(".")[0])
                self.imports[bound] = origin + (alias.name if alias.asname else bound)
        self._sort(tree.body)

    def _sort(self, body: Iterable[ast.AST]) -> None:
        for node in body:
            if isinstance(node, ast.If | ast.Try | ast.With | ast.ExceptHandler):
                self._sort(ast.iter_child_nodes(node))
                continue
            targets = getattr(node, "targets", [getattr(node, "target", None) or ast.Pass()])
            names = [n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)]
            if isinstance(node, (*_FUNCTIONS, ast.ClassDef)):
                names = [node.name]
                self.registered += [(ast.unparse(d).split(".")[0], node.name) for d in node.decorator_list]
            for name in names or [""]:
                self.uses[name].add(node)
                if isinstance(node, ast.stmt):
                    self.definitions[name].append(node)


class Project:
    """All modules by name, and the first of `stages` from which each definition is reached.

    Args:
        root: of the project.
        stages: the first of :data:`STAGES`; only their files are read.
    """

    def __init__(self, root: Path, stages: Collection[str] = STAGES) -> None:
        self.root, self.modules, self.reached = root, dict[str, Module](), dict[Key, str]()
        for stage, folders in ((stage, STAGES[stage]) for stage in stages):
            for path in (p for folder in folders for p in sorted((root / folder).rglob("*.py"))):
                name = ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")
                self.modules[name] = Module(name, stage, path, path.read_text(encoding="utf-8"))
        if "docs" in stages:
            self._read_pages()
        for stage in stages:
            waiting = list(self._roots(stage))
            while waiting:
                key = waiting.pop()
                if key not in self.reached:
                    self.reached[key] = stage
                    waiting += self._next(*key)

    def _read_pages(self) -> None:
        """The code blocks of all pages, as modules."""
        for page in [self.root / "README.md", *sorted((self.root / "docs").glob("*.md"))]:
            for fenced, indented in _CODE_OF_PAGE.findall(page.read_text(encoding="utf-8")):
                if fenced or re.search("^ +(from|import) ", indented, re.MULTILINE):
                    name = f"{page.name}[{len(self.modules)}]"
                    self.modules[name] = Module(name, "docs", page, fenced or textwrap.dedent(indented))

    def _roots(self, stage: str) -> Iterator[Key]:
        """Where a stage begins: of the packages at the entry points, else everywhere."""
        project = tomllib.loads((self.root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        plugins = {name for group in project["entry-points"].values() for name in group.values()}
        for module in (m for m in self.modules.values() if m.stage == stage):
            closed = module.ours and module.name not in plugins
            if not closed or module.name.endswith("__main__") or "__main__" in module.uses[""].strings:
                yield from ((module.name, name) for name in ["", *([] if closed else module.definitions)])
        if stage == "code":
            for entry in project["scripts"].values():
                yield from self._find(entry.replace(":", "."))

    def _find(self, dotted: str) -> list[Key]:
        """What a full dotted name stands for, re-exports looked through; a name comes before a module."""
        parts = dotted.split(".")
        for n in (len(parts) - 1, len(parts), *range(len(parts) - 2, 0, -1)):
            module = self.modules.get(".".join(parts[:n]))
            found = self._resolve(module, ".".join(parts[n:])) if module else []
            if module and (found or n == len(parts)):
                return found or [(module.name, "")]
        return []

    def _resolve(self, module: Module, dotted: str) -> list[Key]:
        """What a name written in `module` stands for."""
        first, _, rest = dotted.partition(".")
        if first in module.definitions:
            return [(module.name, first)]
        origin = module.imports.get(first, "")
        if origin == f"{module.name}.{first}" and origin in self.modules:  # a package's import of its own
            return self._resolve(self.modules[origin], rest) or [(origin, "")]
        if module.stage == "docs" and not origin:  # a page need not repeat its imports
            return [(m.name, first) for m in self.modules.values() if m.ours and first in m.definitions]
        return self._find(f"{origin}.{rest}".strip("."))

    def _next(self, of: str, name: str) -> Iterator[Key]:
        """What a definition uses."""
        module, uses = self.modules[of], self.modules[of].uses[name]
        yield (of, "")
        for key in (key for dotted in uses.names for key in self._resolve(module, dotted)):
            yield key
            if not key[1]:  # a module that is handed about
                yield from ((key[0], a) for a in uses.attributes if a in self.modules[key[0]].definitions)
        for text in (s for s in uses.strings if s.split(".")[0] in PACKAGES):
            yield from self._find(text)
        yield from ((of, function) for by, function in module.registered if by == name)
        if not name:
            yield from self._imported_by_string(module)

    def _imported_by_string(self, module: Module) -> Iterator[Key]:
        """What a module with ``import_module`` may reach: names it spells in modules it spells."""
        every = module.uses.values()
        if "import_module" not in {dotted.split(".")[-1] for uses in every for dotted in uses.names}:
            return
        words = {word for uses in every for word in uses.strings | uses.attributes}
        spelled = words & self.modules.keys()
        if any("__package__" in uses.names for uses in every):
            package = module.name.rpartition(".")[0]
            spelled |= {name for name in self.modules if name.rpartition(".")[0] == package}
        for found in spelled:
            yield from ((found, word) for word in words & self.modules[found].definitions.keys())
