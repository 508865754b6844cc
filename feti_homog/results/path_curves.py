"""Derive stress-strain curves from a path: response to a rising load, legs, components to show.

Points are entries of `path` in result.json: mappings with `load_factor`, `strain` and `stress`, c components in Voigt
order: [11, 22, 12], or [11, 22, 33, 23, 13, 12] in generalized plane strain; stresses in the moduli's unit.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from feti_homog.case import bond_laws, interface_section, load_sections
from feti_homog.materials import voigt
from feti_homog.typing import Float, Int

SAME_LOAD = 1e-9  # relative tolerance for equal load factors
# Fractions of the largest component, below which a component is zero for the solver, or invisible in a plot.
ZERO, FAINT = 1e-7, 1e-4

Point = Mapping[str, Any]
Document = Mapping[str, Any]


def targets(document: Document) -> tuple[dict[str, float], ...]:
    """Return the waypoints of a path, or the single load of analysis `load`, with all components by name."""
    return load_sections.completed(_given(document), document["case"]["analysis"]["plane"])


def named_components(document: Document) -> list[int]:
    """Return the indices of the components that some waypoint names, in Voigt order."""
    loads = _given(document)
    first = load_sections.first_named(loads, document["case"]["analysis"]["plane"])
    return [component for component, number in enumerate(first.values()) if number < len(loads)]


def _given(document: Document) -> list[load_sections.Strain | load_sections.MixedLoad]:
    """Return the loads of the case in `document` as its file gives them, without default components."""
    section = document["case"].get("path") or document["case"]["load"]
    as_written = section.get("waypoints") or [section[name] for name in ("strain", "to") if name in section]
    return [load_sections.MixedLoad(**load) if isinstance(load, Mapping) else tuple(load) for load in as_written]


def changed_components(document: Document, leg: int | None = None) -> list[int]:
    """Return the indices of the components that change on leg number `leg`, from 1, or by default on any leg."""
    pairs, changed = voigt.plane_state_of(document).components, set[int]()
    before: Mapping[str, float] = {stress: 0.0 for _, stress in pairs}
    for number, target in enumerate(targets(document), start=1):
        for component, names in enumerate(pairs):
            old, new = ({name: load[name] for name in names if load.get(name)} for load in (before, target))
            if old != new and leg in (None, number):
                changed.add(component)
        before = target
    return sorted(changed)


def stresses(document: Document) -> Float:
    """Return the stresses (n, c) of the points; stresses within the solver's noise become 0."""
    stress = np.array([point["stress"] for point in document["path"]], float)
    return np.where(np.abs(stress) > noise(document), stress, 0.0)


def noise(document: Document) -> float:
    """Return the stress noise: `ZERO` times the largest stress or, if larger, largest strain times least modulus."""
    strain, stress = (np.abs([point[name] for point in document["path"]]).max() for name in ("strain", "stress"))
    named = [constant for phase in document["case"].get("material", {}).values() for constant in phase.items()]
    moduli = [np.max(value) for name, value in named if value and name.startswith(("young", "E", "G", "stiffness"))]
    return ZERO * float(max(stress, strain * min(moduli, default=0.0)))


def leading_component(document: Document) -> int:
    """Return the index of the component with the largest strain on the leg where damage begins under stress.

    Without such a leg, all points count.  Candidates are the components that the waypoints change there.  If only the
    temperature changes, returns the component with the largest stress or, if no stress acts, the largest strain.
    """
    leg, damaging = legs_of(document), damaging_leg(document, ("broke", "softened"))
    points = np.ones(len(leg), bool) if damaging is None else leg == damaging
    strain = np.array([point["strain"] for point in document["path"]])[points]
    if changed := changed_components(document, damaging):
        return changed[int(np.abs(strain).max(axis=0)[changed].argmax())]
    stress = stresses(document)[points]
    return int(np.abs(stress if stress.any() else strain).max(axis=0).argmax())


def damaging_leg(document: Document, counts: Sequence[str] = ("broke",)) -> int | None:
    """Return the first leg, from 1, that has both damage and stress; None without one.

    A point has damage if one of the entries `counts`, such as `broke`, is positive.
    """
    leg, damaged = legs_of(document), np.array([any(map(point.get, counts)) for point in document["path"]])
    under_stress = np.isin(leg, leg[stresses(document).any(axis=1)])
    return next((int(number) for number in leg[damaged & under_stress]), None)


def abscissa(document: Document) -> tuple[str, Float]:
    """Return the name and values (n,) of the quantity to plot stresses over: the leading strain.

    If this strain stays at zero, or all waypoints change the temperature alone, a nonzero temperature takes its place.
    """
    table, strains = table_of(document["path"]), voigt.voigt_names(len(document["path"][0]["strain"]))[0]
    leading, largest = strains[leading_component(document)], max(np.abs(table[strain]).max() for strain in strains)
    is_held = np.abs(table[leading]).max() <= ZERO * largest or not changed_components(document)
    name = load_sections.TEMPERATURE if is_held and table[load_sections.TEMPERATURE].any() else leading
    return name, table[name]


def abscissas(document: Document) -> list[str]:
    """Return up to three names: the quantity of `abscissa`, then the strains that change most on the legs."""
    strains = voigt.voigt_names(len(document["path"][0]["strain"]))[0]
    leading = (strains[component] for _, component, _ in largest_of_legs(document))
    return list(dict.fromkeys([abscissa(document)[0], *leading]))[:3]


def temperature_of(document: Document, number: int) -> float | None:
    """Return the temperature of point `number` on a leg that changes only the temperature; None elsewhere."""
    point = document["path"][number]
    is_alone = "temperature" in point and not changed_components(document, int(legs_of(document)[number]))
    return point["temperature"] if is_alone else None


def largest_of_legs(document: Document) -> Iterator[tuple[int, int, int]]:
    """Yield (leg, component with the largest strain change, point of its largest stress), unless there is one leg.

    The point that ends a leg also begins the next leg.
    """
    leg, stress = legs_of(document), stresses(document)
    strain = np.array([point["strain"] for point in document["path"]])
    for number in range(1, legs(document) + 1) if legs(document) > 1 else ():
        points = np.flatnonzero(leg == number)
        if len(points):
            change = np.abs(strain[points] - (strain[points[0] - 1] if points[0] else 0.0)).max(axis=0)
            points = np.append(points, max(points[0] - 1, 0))
            changed = changed_components(document, number) or changed_components(document)
            component = max(changed or range(len(change)), key=change.__getitem__)
            yield number, component, int(points[np.abs(stress[points, component]).argmax()])


def legs_of(document: Document) -> Float:
    """Return the leg (n,) of each point, counted from 1."""
    position = legs(document) * np.array([point["load_factor"] for point in document["path"]])
    return np.asarray(np.ceil(position - SAME_LOAD * legs(document)).clip(1))


def components_above(share: float, values: Float) -> list[int]:
    """Return the columns of `values` (n, c) with a magnitude above `share` times the largest magnitude."""
    largest = np.abs(values).max(axis=0, initial=0.0)
    return [int(column) for column in np.flatnonzero(largest > share * largest.max(initial=0.0))]


def shown_components(document: Document) -> list[str]:
    """Name the stresses on a path that a plot shows (above FAINT times the largest); without stress, such strains."""
    strains, names = voigt.voigt_names(len(document["path"][0]["stress"]))
    if visible := components_above(FAINT, stresses(document)):
        return [names[component] for component in visible]
    values = np.array([point["strain"] for point in document["path"]], float)
    return [strains[component] for component in components_above(FAINT, values)]


def what_rises(document: Document) -> str:
    """Name the quantity that rises on the first leg: "strain" if it prescribes strains alone, else "load"."""
    first = targets(document)[0]
    other_loads = {*voigt.plane_state_of(document).stresses, load_sections.TEMPERATURE}
    return "load" if any(first[name] for name in other_loads & first.keys()) else "strain"


def legs(document: Document) -> int:
    """Return the number of straight legs of a path, one for each waypoint."""
    return len(document["case"]["path"].get("waypoints", [0]))


def first_leg(document: Document) -> int:
    """Return the number of points on the first leg of an event path; of all points for increments."""
    by_events = document["case"]["path"]["method"] == "events"
    return int((legs_of(document) <= 1).sum()) if by_events else len(document["path"])


def ends_of_legs(document: Document) -> list[int]:
    """Return the number of the last point at each waypoint; waypoints that the path does not reach are left out."""
    count = legs(document)
    position = count * np.array([point["load_factor"] for point in document["path"]])
    at_ends = (np.flatnonzero(np.abs(position - leg) <= SAME_LOAD * count) for leg in range(1, count + 1))
    return [int(numbers[-1]) for numbers in at_ends if len(numbers)]


def is_stopped(document: Document) -> bool:
    """Return whether a path is unfinished, or has as many events as the case allows."""
    return "unfinished" in document or len(document["path"]) >= document["case"]["path"].get("max_events", np.inf)


def is_proportional(document: Document) -> bool:
    """Return whether the response between breaks is always a ray from zero: on an event path with one leg."""
    return document["case"]["path"]["method"] == "events" and legs(document) == 1


def breaks(point: Point) -> bool:
    """Return whether bonds break or soften at a point."""
    return bool(point["broke"] or point.get("softened"))


def later_corners(document: Document) -> list[Point]:
    """Return the points of an event path beyond the first leg, with a corner before each point that follows a break.

    A corner has the load of the break; from there the response leads straight to the point, with strain E' and stress
    S'.  Prescribed strains E or stresses S of the corner equal the break's, others are NaN.  If the leg changes one
    component alone, its conjugate follows from the work after the break: (S + S') (E' - E) / 2, plus work at constant
    stress.
    """
    pairs, loads, leg = voigt.plane_state_of(document).components, targets(document), legs_of(document)
    points, corners = document["path"], list[Point]()
    for number in range(first_leg(document), len(points)):
        start, point = points[number - 1], points[number]
        if breaks(start) and point["load_factor"] - start["load_factor"] > SAME_LOAD:
            by_stress = np.array([name in loads[int(leg[number]) - 1] for _, name in pairs])
            strain, stress = np.array(start["strain"]), np.array(start["stress"])
            rise, work = np.array(point["strain"]) - strain, point["work"] - start["work"]
            behind = {"strain": np.where(by_stress, np.nan, strain), "stress": np.where(by_stress, stress, np.nan)}
            changed = changed_components(document, int(leg[number]))
            if len(changed) == 1 and start.get("temperature") == point.get("temperature"):
                (k,) = changed
                work -= float((stress * rise)[by_stress].sum())
                if not by_stress[k]:
                    behind["stress"][k] = 2.0 * work / rise[k] - point["stress"][k]
                elif change := point["stress"][k] - stress[k]:
                    behind["strain"][k] = point["strain"][k] - 2.0 * work / change
            corners.append({**start, **behind})
        corners.append(point)
    return corners


def scales_with_toughness(document: Document) -> bool:
    """Return whether strains and stresses along a path are proportional to the root of the toughness.

    This holds if all bonds break by energy, on springs that do not depend on the toughness.
    """
    tables = interface_section.interface_tables(document["case"])
    laws = [bond_laws.LAWS.get(table.get("criterion", bond_laws.DEFAULT)) for table in tables]
    by_energy = [law is not None and "toughness" in law.keys and not law.softens for law in laws]
    return bool(document.get("path")) and bool(laws) and all(by_energy)


def rising_points(points: Sequence[Point]) -> Int:
    """Return the numbers of the points at or above all earlier loads, which a rising load reaches."""
    load = np.array([point["load_factor"] for point in points])
    return np.flatnonzero(load >= np.maximum.accumulate(load))


def table_of(points: Sequence[Point]) -> dict[str, Float]:
    """Return arrays (n,) over the points, by name: all stresses, all strains, and the temperature (0 if absent)."""
    strains, names = voigt.voigt_names(len(points[0]["stress"]))
    rows = [[*point["stress"], *point["strain"], point.get("temperature") or 0.0] for point in points]
    return dict(zip((*names, *strains, load_sections.TEMPERATURE), np.array(rows, float).T, strict=True))


def largest_jump(document: Document, strain: str, least: float) -> tuple[int, int] | None:
    """Return the points between which `strain` changes most at one load; None up to the fraction `least` of it."""
    values, load = table_of(document["path"])[strain], [point["load_factor"] for point in document["path"]]
    runs = np.split(np.arange(len(load)), np.flatnonzero(np.abs(np.diff(load)) > SAME_LOAD) + 1)
    ends = max(((int(run[0]), int(run[-1])) for run in runs), key=lambda ends: float(abs(np.diff(values[[*ends]]))[0]))
    return ends if abs(values[ends[1]] - values[ends[0]]) > least * np.abs(values).max() else None


def load_controlled(points: Sequence[Point]) -> Float:
    """Return the v corners of a proportional path under a rising load: stresses, strains, temperature, (v, 2 c + 1).

    Where bonds break at a load t, all bonds that cannot carry t without these bonds also break.  The cell then follows
    the next stable branch, with a point at load t'.  Each branch is a ray through zero: Sigma(t) = Sigma(t') t / t',
    and the strains likewise.  Under a prescribed strain the stress falls; under a prescribed stress the strain jumps.
    """
    load = np.array([point["load_factor"] for point in points])
    values = np.array([*table_of(points).values()]).T
    reached = rising_points(points)
    corners = [np.zeros(values.shape[1]), values[reached[0]]]
    for before, after in pairwise(reached):
        corners += [values[after] * load[before] / load[after], values[after]]
    return np.array(corners)


def rising_strain(document: Document) -> Float | None:
    """Return the v corners of a one-leg path under a rising load: stresses and `leading_component` strain, (v, c + 1).

    The strain is made positive.  Returns None without a path, with several legs, or if the strain falls somewhere.
    """
    points = document.get("path")
    if not points or legs(document) != 1:
        return None
    if is_proportional(document):
        curve = load_controlled(points)
    else:
        curve = np.array([np.append(0.0, values) for values in table_of(points).values()]).T
    count = curve.shape[1] // 2
    stress, strain = curve[:, :count], curve[:, count + leading_component(document)]
    strain = strain * np.sign(strain[-1])
    if np.any(np.diff(strain) < -ZERO * strain[-1]):
        return None
    return np.column_stack([stress, np.maximum.accumulate(strain)])
