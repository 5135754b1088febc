"""The reference of the Python package, name by name, from its stubs and docstrings.

    python scripts/python_reference.py                  writes target/python_reference.md
    python scripts/python_reference.py -o reference.md  writes it elsewhere

The names are those of `__all__` in the package and in its modules without an underscore; nothing is imported, so nothing need be built.
"""

import argparse
import ast
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "crates/python/python/resight"
PAGE = ROOT / "target/python_reference.md"
WIDTH = 120
HEAD = """# The Python package, name by name

From the stubs and docstrings of the package by `python scripts/python_reference.py`. `docs/python.md` shows how to
work with it, `CONVENTIONS.md` what frames and units are. `Image` is a path, the bytes of a PNG or JPEG, or a grey array (height, width) of uint8.
"""
Definition = ast.FunctionDef | ast.ClassDef | ast.AnnAssign


def tree(module: str) -> ast.Module:
    """The stub of a module where it has one, else its source."""
    stub, source = PACKAGE / f"{module}.pyi", PACKAGE / f"{module}.py"
    return ast.parse((stub if stub.exists() else source).read_text())


def public_names(parsed: ast.Module) -> list[str]:
    """What `__all__` lists."""
    for node in parsed.body:
        if isinstance(node, ast.Assign) and any(isinstance(t, ast.Name) and t.id == "__all__" for t in node.targets):
            return ast.literal_eval(node.value)
    raise SystemExit("a module without __all__")


def origins(parsed: ast.Module) -> dict[str, tuple[str, str]]:
    """Name → module of the package that defines it, and its name there."""
    imports = [node for node in parsed.body if isinstance(node, ast.ImportFrom) and node.level == 1 and node.module]
    return {alias.asname or alias.name: (node.module, alias.name) for node in imports for alias in node.names}


def definitions(parsed: ast.Module) -> dict[str, tuple[Definition, str]]:
    """Name → its definition and its docstring; a variable's docstring is the string behind it."""
    found: dict[str, tuple[Definition, str]] = {}
    for node, after in zip(parsed.body, [*parsed.body[1:], ast.Pass()]):
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            found[node.name] = node, ast.get_docstring(node) or ""
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            is_text = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) and isinstance(after.value.value, str)
            found[node.target.id] = node, after.value.value if is_text else ""
    return found


def names_of(module: str) -> dict[str, tuple[Definition, str]]:
    """Every public name of a module with its definition and docstring, in the order of `__all__`; "" is the package itself."""
    parsed = tree(module or "__init__")
    own, imported = definitions(parsed), origins(parsed)
    found = {}
    for name in public_names(parsed):
        if name in own:
            found[name] = own[name]
        elif name in imported:
            origin, there = imported[name]
            found[name] = definitions(tree(origin))[there]
        else:
            raise SystemExit(f"{module or 'resight'}: {name} is in __all__ and nowhere defined")
    return found


def public_modules() -> list[str]:
    """Modules that a user imports by name."""
    return sorted(path.stem for path in PACKAGE.glob("*.py") if not path.stem.startswith("_"))


def decorators(node: ast.FunctionDef) -> set[str]:
    return {decorator.id for decorator in node.decorator_list if isinstance(decorator, ast.Name)}


def shown_type(code: str) -> str:
    """The private names of the stubs as a reader knows them."""
    for private, known in (("_Array", "NDArray[float64]"), ("_Image", "Image"), ("_native.", "")):
        code = code.replace(private, known)
    return code


def signature(name: str, node: ast.FunctionDef, is_method: bool) -> str:
    """The call as a user writes it, one argument a line where it is long; methods without `self`."""
    arguments = node.args
    if is_method and "staticmethod" not in decorators(node):
        without_self = [list(arguments.posonlyargs), list(arguments.args)]
        del next(part for part in without_self if part)[0]
        arguments = ast.arguments(**{**{f: getattr(arguments, f) for f in arguments._fields}, "posonlyargs": without_self[0], "args": without_self[1]})
    returns = "" if node.returns is None else f" -> {ast.unparse(node.returns)}"
    line = shown_type(f"{name}({ast.unparse(arguments)}){returns}")
    if len(line) <= WIDTH:
        return line
    return shown_type(f"{name}(\n" + "".join(f"    {piece},\n" for piece in pieces(arguments)) + f"){returns}")


def pieces(arguments: ast.arguments) -> list[str]:
    """Each argument as it is written, with the star of those that are given by name alone."""
    one = lambda **fields: ast.unparse(ast.arguments(**{"posonlyargs": [], "args": [], "kwonlyargs": [], "kw_defaults": [], "defaults": [], **fields}))
    places = [*arguments.posonlyargs, *arguments.args]
    defaults = [None] * (len(places) - len(arguments.defaults)) + list(arguments.defaults)
    listed = [one(args=[place], defaults=[default] if default else []) for place, default in zip(places, defaults)]
    if arguments.vararg:
        listed.append(one(vararg=arguments.vararg))
    elif arguments.kwonlyargs:
        listed.append("*")
    listed += [one(kwonlyargs=[named], kw_defaults=[default])[3:] for named, default in zip(arguments.kwonlyargs, arguments.kw_defaults)]
    return listed + ([one(kwarg=arguments.kwarg)] if arguments.kwarg else [])


def fenced(code: str) -> str:
    return f"```python\n{code}\n```\n"


def members(name: str, node: ast.ClassDef) -> list[str]:
    """Attributes as a table, then each method; of the names with underscores only the operators that have a docstring."""
    functions = [item for item in node.body if isinstance(item, ast.FunctionDef)]
    shown = [f for f in functions if not f.name.startswith("_") or (f.name.startswith("__") and ast.get_docstring(f) and f.name != "__init__")]
    attributes = [f for f in shown if "property" in decorators(f)]
    parts = []
    if attributes:
        rows = ["| attribute | type | |", "| --- | --- | --- |"]
        for attribute in attributes:
            kind = shown_type(ast.unparse(attribute.returns)).replace("|", "\\|") if attribute.returns else ""
            rows.append(f"| `{attribute.name}` | `{kind}` | {' '.join((ast.get_docstring(attribute) or '').split())} |")
        parts.append("\n".join(rows) + "\n")
    for method in shown:
        if "property" not in decorators(method):
            before = f"{name}." if "staticmethod" in decorators(method) else ""
            parts.append(fenced(signature(before + method.name, method, True)) + "\n" + (ast.get_docstring(method) or "") + "\n")
    return parts


def section(module: str, name: str, node: Definition, text: str) -> str:
    shown = f"{module}.{name}" if module else name
    parts = [f"### {shown}\n"]
    if isinstance(node, ast.FunctionDef):
        parts.append(fenced(signature(shown, node, False)))
    elif isinstance(node, ast.ClassDef):
        bases = ", ".join(ast.unparse(base) for base in node.bases)
        made = [f for f in node.body if isinstance(f, ast.FunctionDef) and f.name in ("__new__", "__init__")]
        parts.append(fenced(signature(shown, made[0], True).removesuffix(" -> None") if made else f"class {shown}" + (f"({bases})" if bases else "")))
    else:
        parts.append(fenced(ast.unparse(node)))
    parts.append(text + "\n")
    return "\n".join(parts + (members(name, node) if isinstance(node, ast.ClassDef) else []))


def page() -> str:
    parts = [HEAD]
    for module in ["", *public_modules()]:
        intro = ast.get_docstring(tree(module)) if module else None
        parts.append(f"## resight{'.' + module if module else ''}\n" + (f"\n{intro}\n" if intro else ""))
        parts += [section(module, name, *found) for name, found in names_of(module).items()]
    return "\n".join(parts)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=PAGE, help="the page to write")
    output = parser.parse_args().output
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_text(page())
    print(f"written: {output}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
