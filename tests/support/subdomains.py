"""All subdomains of a coarse cell on one rank."""

from collections.abc import Iterator

import numpy as np

from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.submeshes import SubdomainTable, Submesh, cut_for_ranks, pinned_classes
from feti_homog.typing import Int


def cut(torus: Torus, subdomain: Int) -> Iterator[Submesh]:
    """Cut the coarse cell into its subdomains; `subdomain` (m,) numbers each triangle's, from 0 without gaps."""
    table = SubdomainTable.of(torus, subdomain, np.zeros(subdomain.max() + 1, np.int64))
    for rank in cut_for_ranks(torus, subdomain, table, 1, pinned_classes(torus)):
        yield from rank.cut()
