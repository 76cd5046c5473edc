"""What holds for all tests: the largest model takes part in the loops over all models only when slow tests run."""

import pytest

LONG = "waveboard"


def pytest_collection_modifyitems(items):
    for item in items:
        if LONG in item.name.partition("[")[2]:
            item.add_marker(pytest.mark.slow)
