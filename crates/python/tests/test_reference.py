"""The generated reference has every public name, and every name has a docstring that explains it."""

import ast
import importlib
import runpy

import pytest

from conftest import ROOT

SCRIPT = runpy.run_path(str(ROOT / "scripts/python_reference.py"))
MODULES = ["", *SCRIPT["public_modules"]()]


def test_the_page_has_a_section_for_every_public_name():
    lines = set(SCRIPT["page"]().splitlines())
    for module in MODULES:
        prefix = f"{module}." if module else ""
        assert [name for name in SCRIPT["names_of"](module) if f"### {prefix}{name}" not in lines] == []


@pytest.mark.parametrize("module", MODULES)
def test_every_public_name_has_a_docstring_of_more_than_its_name(module):
    for name, (_, text) in SCRIPT["names_of"](module).items():
        words = {word.lower() for word in text.replace("`", " ").split()}
        assert 3 <= len(words - set(name.lower().split("_"))), f"{module or 'resight'}.{name}: {text!r}"


def test_every_public_member_of_a_class_has_a_docstring():
    for module in MODULES:
        for name, (node, _) in SCRIPT["names_of"](module).items():
            members = [item for item in getattr(node, "body", []) if isinstance(item, ast.FunctionDef) and not item.name.startswith("_")]
            assert [member.name for member in members if not ast.get_docstring(member)] == [], name


@pytest.mark.parametrize("module", MODULES)
def test_the_names_are_those_that_import_gives(module):
    """The page is read from the sources; a name that only exists there would be documented and not there."""
    imported = importlib.import_module(f"resight.{module}" if module else "resight")
    assert sorted(imported.__all__) == sorted(SCRIPT["names_of"](module))
    assert all(hasattr(imported, name) for name in imported.__all__)


def test_a_name_that_is_added_is_found_and_one_without_a_definition_is_refused():
    parsed = ast.parse("def later(a: int, *, b_m: float = 1.0) -> None:\n    'What it does.'\n")
    node, text = SCRIPT["definitions"](parsed)["later"]
    assert text == "What it does." and SCRIPT["signature"]("later", node, False) == "later(a: int, *, b_m: float=1.0) -> None"
    namespace = SCRIPT["names_of"].__globals__
    before = namespace["tree"]
    namespace["tree"] = lambda module: ast.parse("__all__ = ['nowhere']")
    try:
        with pytest.raises(SystemExit, match="nowhere is in __all__"):
            SCRIPT["names_of"]("")
    finally:
        namespace["tree"] = before


