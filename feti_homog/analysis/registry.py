"""The analyses by the value of [analysis] type; the module of one is imported when a case asks for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from feti_homog.analysis.context import AnalysisContext
from feti_homog.case.case import Case


@dataclass(frozen=True)
class Analysis:
    """An analysis: `ANALYSIS` of the module of its name.

    Attributes:
        run: its entries of `Result`, by name; collective.
        table: whether the entry of its name has points, which NAME.csv lists.
        events: whether its points are events, with a checkpoint and a log.
    """

    run: Callable[[AnalysisContext], dict[str, Any]]
    table: bool = False
    events: bool = False


def analysis_of(case: Case) -> Analysis:
    """Return the analysis that a case asks for."""
    analysis: Analysis = import_module(f"feti_homog.analysis.{case.analysis.type}").ANALYSIS
    return analysis
