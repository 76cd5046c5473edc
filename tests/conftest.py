"""What holds for all tests: the largest models take part in the loops over all models only when
slow tests run."""

import pytest

LONG = ("[waveboard", "test_models_need_no_more_than_their_graph[bicycle")


def pytest_collection_modifyitems(items):
    for item in items:
        if any(part in item.name for part in LONG):
            item.add_marker(pytest.mark.slow)
