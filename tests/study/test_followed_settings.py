"""Which curves are followed round folds."""

from dataclasses import replace

import numpy as np
import pytest
from models import block

from bladefem.study.adaptive.family import Family, Member
from bladefem.study.adaptive.followed_settings import too_large_to_follow
from bladefem.study.adaptive.settings import first_for


@pytest.mark.parametrize(
    ("nodes", "softened", "too_large"),
    [(16, False, False), (20, False, True), (16, True, True), (12, True, False)],
)
def test_softened_layers_are_followed_with_fewer_unknowns(nodes, softened, too_large):
    """Eight contact points a seat and seven harmonics are 720 unknowns: the shipped wedge under
    36 N is followed with these, a softened layer, whose paths have many folds, is not.
    """
    model = block(nodes, dofs=3 * nodes + 2)
    family = Family(lambda _: Member(model, np.arange(nodes)), 1)
    settings = replace(first_for(10), harmonics=7, softened=softened)
    assert model.unknowns(7) == 45 * nodes
    assert too_large_to_follow(family, settings) == too_large
