"""Names that are loaded when they are first used are where the tables of the packages say."""

import pytest

import bladefem
from bladefem import balance


@pytest.mark.parametrize("package", [bladefem, balance], ids=lambda package: package.__name__)
def test_every_public_name_can_be_loaded(package):
    assert package.__all__
    for name in package.__all__:
        assert getattr(package, name) is not None
