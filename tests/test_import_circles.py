"""No two modules of the package import each other, directly or around others, not even for types."""

from collections.abc import Mapping, Set
from graphlib import CycleError, TopologicalSorter

import grimp
import pytest


def check_order(imports: Mapping[str, Set[str]]) -> None:
    """Check that the modules can be put in an order in which each imports only those before it.

    Raises:
        CycleError: If they import each other; its second argument is a circle of them.
    """
    TopologicalSorter(imports).prepare()


def test_no_modules_import_each_other() -> None:
    graph = grimp.build_graph("faceposer", exclude_type_checking_imports=False, cache_dir=None)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    assert "faceposer.gui.feature" in imports["faceposer.gui.features.keys.feature"]
    # The package offers the interface by its own name; it is imported when somebody asks for it.
    imports["faceposer"] = imports["faceposer"] - {"faceposer.api"}
    check_order(imports)


def test_circles_are_found() -> None:
    with pytest.raises(CycleError) as caught:
        check_order({"dialog": {"feature"}, "feature": {"state"}, "state": {"widgets", "dialog"}, "widgets": set()})
    assert set(caught.value.args[1]) == {"dialog", "feature", "state"}
