import ast
import doctest
import inspect
import pathlib

import tactomo
from tactomo import _tactomo

STUB = pathlib.Path(tactomo.__file__).with_name("_tactomo.pyi")


def public(names):
    return {name for name in names if not name.startswith("_")}


def test_types_are_told_of_all_there_is_and_of_nothing_else():
    tree = ast.parse(STUB.read_text())
    classes = {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}
    for name, node in classes.items():
        cls = getattr(tactomo, name)
        told = {part.name for part in node.body if isinstance(part, ast.FunctionDef)}
        assert public(told) == public(vars(cls)), name
    functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    values = {node.target.id for node in tree.body if isinstance(node, ast.AnnAssign)}
    assert public(classes) | functions | public(values) == public(vars(_tactomo)) == public(tactomo.__all__)
    assert STUB.with_name("py.typed").exists()


def test_names_of_solvers_and_scenes_are_told_as_they_are():
    tree = ast.parse(STUB.read_text())
    told = {node.target.id: node.value for node in tree.body if isinstance(node, ast.AnnAssign) and node.value}
    for alias, names in {"_SolverName": tactomo.SOLVERS, "_SceneName": tactomo.SCENES}.items():
        assert [name.value for name in told[alias].slice.elts] == list(names), alias


def test_everything_public_is_documented():
    for name in public(tactomo.__all__):
        thing = getattr(tactomo, name)
        if not callable(thing):
            continue
        assert inspect.getdoc(thing), name
        for part in public(vars(thing)) if inspect.isclass(thing) else ():
            assert inspect.getdoc(getattr(thing, part)), f"{name}.{part}"


def test_examples_in_the_documentation_are_true():
    result = doctest.testmod(tactomo)
    # Six in the package, four in classes, and one that needs time and is left out.
    assert result.attempted >= 10 and result.failed == 0
