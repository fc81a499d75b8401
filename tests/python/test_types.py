"""The examples in the texts are true, and each function of the extension is declared for type checkers."""
import ast
import doctest
import importlib
import pathlib

import pytest

import karst
from karst import _karst

MODULES = ["", ".camera", ".edits", ".engine", ".errors", ".info", ".points", ".saved", ".world"]


@pytest.mark.parametrize("name", MODULES)
def test_examples(name):
    module = importlib.import_module("karst" + name)
    found = doctest.testmod(module, optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE,
                            extraglobs={"karst": karst})
    assert found.failed == 0


def test_each_function_is_declared():
    folder = pathlib.Path(karst.__file__).parent
    assert (folder / "py.typed").exists()
    tree = ast.parse((folder / "_karst.pyi").read_text())
    declared = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    declared |= {node.target.id for node in tree.body if isinstance(node, ast.AnnAssign)}
    assert declared == {name for name in dir(_karst) if not name.startswith("__")}


def test_everything_public_says_what_it_is():
    for name in karst.__all__:
        thing = getattr(karst, name)
        if isinstance(thing, type) or callable(thing):
            assert thing.__doc__, name
