"""Build the table of a path: peak, energies, and rows for selected points."""

from textwrap import wrap

import numpy as np

from feti_homog.case import load_sections
from feti_homog.materials import voigt
from feti_homog.report.text.point_tables import COUNTS, STATES, columns_without_noise, debonded, energies
from feti_homog.report.text.tables import WIDTH, Column, Table, stress_label, without_noise
from feti_homog.results import landmarks, path_curves
from feti_homog.typing import Document

ROWS = 15  # rows of the table, unless the caller limits them


def path_table(document: Document, limit: int | None = None) -> Table:
    """Return the table of a path, with totals above rows of points.

    There are at most `limit` rows, by default `ROWS`.  The first five of these columns appear; a line names the others:
    leading strain (temperature if it varies alone), prescribed strains, named and acting stresses, temperature, strains
    under prescribed stresses.
    """
    points, numbers = document["path"], landmarks.chosen(document, limit or ROWS)
    strain, stress = columns_without_noise([point["strain"] for point in points]), path_curves.stresses(document)
    strains, stresses = voigt.voigt_names(strain.shape[1])
    axis, values = path_curves.abscissa(document)
    visible = {*path_curves.named_components(document), *path_curves.components_above(path_curves.FAINT, stress)}
    prescribed = {name for target in path_curves.targets(document) for name in target}
    acting = path_curves.components_above(path_curves.FAINT, strain)
    driven = [k for k in acting if strains[k] in prescribed and path_curves.legs(document) > 1]
    varying = {axis: values} | {strains[k]: strain[:, k] for k in driven}
    varying |= {stresses[k]: stress[:, k] for k in sorted(visible)}
    if any(point.get("temperature") for point in points):
        varying[load_sections.TEMPERATURE] = np.array([point["temperature"] for point in points])
    varying |= {strains[k]: strain[:, k] for k in acting if stresses[k] in prescribed}
    names, rest = [*varying][:5], [*varying][5:]
    broke = sum(point["broke"] for point in points)
    some = "" if len(numbers) == len(points) else f", {len(numbers)} shown"
    load = ("load_factor", *STATES)
    rows = [[k, *(without_noise(varying[name][k]) for name in names), *map(points[k].get, load)] for k in numbers]
    noun, label = document["case"]["path"]["method"].removesuffix("s"), stress_label(document)
    columns = [Column(noun, len(noun), "d"), *(Column(name, max(11, len(name) + 1)) for name in names)]
    columns += [Column("load", 9, ".6f"), *COUNTS]
    peak = landmarks.peak_of(document)
    totals = [*_peak_lines(document, peak), *jump_lines(document, peak), *_path_energies(document, label)]
    totals += [f"Also in path.csv: {', '.join(rest)}"] if rest else []
    return Table(f"Path{label}: {len(points)} {noun}s{some}; {broke} bonds broke", columns, rows, totals)


def _peak_lines(document: Document, peak: Document) -> list[str]:
    """Describe the peak, the first break, the path after the peak, and scaling by the toughness."""
    largest, name = landmarks.name_of(document, peak), peak["stress_name"] + stress_label(document)
    noun = document["case"]["path"]["method"].removesuffix("s")
    leg_of, event = path_curves.legs_of(document), peak.get("event", len(document["path"]) - 1)
    curve = "the path" if leg_of[-1] == 1 else f"leg {leg_of[event]:.0f}"
    end = np.flatnonzero(leg_of == leg_of[event])[-1]
    begins = {landmarks.PEAK: f"Peak {name}", landmarks.SO_FAR: f"Largest {name} so far, the path being cut off"}
    if peak["stress_name"] in path_curves.targets(document)[int(leg_of[event]) - 1] and not path_curves.is_stopped(
        document
    ):
        begins[landmarks.SO_FAR] = f"Limit load {name}"
    begins[landmarks.LARGEST] = f"{name} at the end of {curve}, no peak yet" if event == end else f"Largest {name}"
    text = "No stress acts on the path, and there is no peak"
    if "event" in peak:
        text = f"{begins[largest]}: {_landmark(document, peak, '')}"
    within = "in the step to " if noun == "increment" else ""
    for title in ("first_softening_", "first_break_"):
        if f"{title}event" in peak:
            text += f"; {title.replace('_', ' ')}{within}{_landmark(document, peak, title)}"
    stresses = path_curves.table_of(document["path"])[peak["stress_name"]]
    if "event_left" in peak:
        valley, lost = peak["event_left"], 1.0 - peak["stress_left"] / peak["stress"]
        is_rising = noun == "event" and leg_of[valley] == 1
        is_given = path_curves.targets(document)[0].get(peak["stress_name"])
        way = "along all equilibria" if is_given else f"as the {path_curves.what_rises(document)} rises"
        rises = f" {way}" if is_rising else ""
        before = "before " if abs(peak["stress_left"] - stresses[valley]) > path_curves.noise(document) else ""
        text += f"; then falls by {lost:.1%} to {peak['stress_left']:.6g}{rises} ({before}{noun} {valley})"
    later = event + int((stresses[event:] * np.sign(peak.get("stress", 1.0))).argmax())
    if later > event and abs(stresses[later]) > (1.0 + path_curves.ZERO) * abs(peak["stress"]):
        text += f"; later {stresses[later]:.6g} ({noun} {later})"
    if largest == landmarks.LARGEST and event != end:
        below = 1.0 - stresses[end] / peak["stress"]
        near = f"near its peak, {below:.1%} below it" if abs(below) > path_curves.ZERO else "at this stress"
        text += f"; {curve} ends {near}"
    places = {"the first break": peak.get("first_break_event"), f"the {largest}": peak.get("event")}
    errors = {place: document["path"][k].get("mesh_error") for place, k in places.items() if k is not None}
    parts = [f"{error:.1e} at {place}" for place, error in errors.items() if error is not None]
    text += f"; mesh error of the energy {', '.join(parts)}" if parts else ""
    lines = wrap(text, WIDTH, subsequent_indent="  ")
    strains, stress_names = voigt.voigt_names(len(document["path"][0]["stress"]))
    legs: dict[tuple[int, int], int] = {}
    for leg, k, number in path_curves.largest_of_legs(document):
        legs.setdefault((k, number), leg)  # a leg that unloads may begin at the largest stress of the leg before
    for (k, number), leg in legs.items():
        strain, stress = document["path"][number]["strain"][k], path_curves.stresses(document)[number, k]
        is_given = stress_names[k] in path_curves.targets(document)[leg - 1]
        if strains[k] != peak["strain_name"] and stress and not is_given:
            name, at = stress_names[k] + stress_label(document), _load_at(document, number, strains[k], strain)
            lines.append(f"Largest {name} of leg {leg}: {stress:.6g} at {at} (point {number})")
    if path_curves.scales_with_toughness(document) and path_curves.legs(document) == 1:
        lines.append("Scaling: strains and stresses of the path grow with the root of the toughness")
    return lines


def jump_lines(document: Document, peak: Document) -> list[str]:
    """Describe the largest jump of the leading strain if its given stress is largest at the end; else [].

    Under a given strain the stress would fall there.
    """
    name, stress = peak["strain_name"], peak["stress_name"]
    jump = path_curves.largest_jump(document, name, landmarks.LEAST_DROP)
    if "event" not in peak or landmarks.name_of(document, peak) != landmarks.LARGEST or jump is None:
        return []
    if stress not in path_curves.targets(document)[int(path_curves.legs_of(document)[peak["event"]]) - 1]:
        return []
    table, (first, last) = path_curves.table_of(document["path"]), jump
    way, at = f"from {table[name][first]:.6g} to {table[name][last]:.6g}", f"{stress} = {table[stress][first]:.6g}"
    return [f"{name} jumps {way} at {at}: prescribe {name} for the peak"]


def _landmark(document: Document, peak: Document, title: str) -> str:
    """Describe the landmark whose keys in `peak` begin with `title`: stress if any, load, event or increment, bond."""
    event, stress = peak[f"{title}event"], without_noise(peak[f"{title}stress"])
    place = f"{document['case']['path']['method'].removesuffix('s')} {event}"
    of_stress = f"{stress:.6g} " if stress or path_curves.temperature_of(document, event) is None else ""
    at = _load_at(document, event, "" if title else peak["strain_name"], peak[f"{title}strain"])
    return f"{of_stress}at {at} ({', '.join(filter(None, [place, landmarks.bond_of(peak, title)]))})"


def _load_at(document: Document, number: int, name: str, strain: float) -> str:
    """Write the strain of a point with its name, if any, or the temperature on a leg that changes only temperature."""
    if (temperature := path_curves.temperature_of(document, number)) is not None:
        return f"{load_sections.TEMPERATURE} = {without_noise(temperature):.6g}"
    return f"{name} = {without_noise(strain):.6g}" if name else f"{without_noise(strain):.6g}"


def _path_energies(document: Document, label: str) -> list[str]:
    """Describe the energies along a path.

    The lines give the work of the loads, energies stored and lost by breaks, along all equilibria and under a rising
    load, frictional heat and fracture energy if any, and the debonded fraction.
    """
    points, last = document["path"], dict(document["path"][-1])
    size = max(abs(point["work"]) for point in points)
    for name in {"work", "stored", "stored_in_springs", "dissipated", "friction_heat"} & last.keys():
        last[name] = without_noise(last[name], size)
    where = " on the first leg" if path_curves.legs(document) > 1 else ""
    rising = f"{last['dissipated_strain_controlled']:.6g} if the {path_curves.what_rises(document)} only rises{where}"
    lines = [f"Work per area{label}: {last['work']:.6g}", *energies(last, label)]
    lines.append(f"Dissipated per area{label}: {last['dissipated']:.6g}")
    if document["case"]["path"]["method"] == "events" and "friction_heat" not in last:  # snap-backs are followed
        lines[-1] += f" along all equilibria, {rising}"
    if "friction_heat" in last:
        lines.append(f"Heat of friction per area{label}: {last['friction_heat']:.6g}")
        ends = [points[number] for number in path_curves.ends_of_legs(document)]
        for point in reversed(ends[:-1]):
            loads = [np.array([point[name], ends[-1][name]]) for name in ("strain", "temperature") if name in point]
            if all(np.ptp(pair, axis=0).max() <= 1e-6 * np.abs(pair).max() for pair in loads):  # a closed loop
                lines[-1] += f", area of the last closed loop {ends[-1]['work'] - point['work']:.6g}"
                break
    if "dissipation_ratio" in last:
        ratio = f"dissipated / fracture energy: {last['dissipation_ratio']:.4f}"
        lines.append(f"Fracture energy per area{label}: {last['fracture_energy']:.6g}; {ratio}")
    return [*lines, *debonded(document, last)]
