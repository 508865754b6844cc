"""Write report.html: one page with all tables, pictures, cards and the case of a result, readable offline."""

import base64
from contextlib import suppress
from html import escape
from importlib import resources
from pathlib import Path
from string import Template

import tomli_w

from feti_homog.errors import CaseError
from feti_homog.materials import voigt
from feti_homog.report.cards import export
from feti_homog.report.text.summary import REMARKS, answers, checks, summary, title_of
from feti_homog.results import atomic, output_folder
from feti_homog.typing import Document

NAME = "report.html"
UNIT_LOADS = dict.fromkeys((*voigt.STRAINS, *voigt.SPATIAL_STRAINS, "temperature"))
PICTURES = {
    "cell": "The cell: phases and numbers of the fibres",
    "partition": "The subdomains",
    **{f"case_{load}": f"Deformed cell under {load}" for load in UNIT_LOADS},
    **{f"case_minus_{load}": f"Deformed cell under minus {load}" for load in UNIT_LOADS},
    **{f"case_dT_dx{k}": f"Flux and isotherms under a unit gradient along x{k}" for k in (1, 2)},
    "angle": "Response against the debonding angle",
    "angle_states": "Deformed cell at several angles",
    "path": "Response along the load path",
    "path_states": "Deformed cell along the path",
    "energy": "Energies along the path",
    "load": "Deformed cell under the load",
    "envelope": "Onset of debonding",
    "interface": "Tractions and jumps of interfaces",
    "mesh_error": "Estimated error of the mesh",
    "sensitivities": "Relative changes of constants with each parameter",
}
MOST_ROWS = 60  # rows of a table of points
# The policy lets the page fetch nothing, whatever the content.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"


def write(directory: Path) -> Path:
    """Write `directory`/report.html from result.json and the stored pictures; return its path.

    Call on one rank.  Raises CaseError if the folder has no result, or has a missing or damaged file; FetiHomogError if
    result.json cannot be read, or the report cannot be written.
    """
    document = output_folder.latest(directory)
    atomic.remove_unfinished(directory, output_folder.RESULT_FILE, alone=False)
    try:
        html = page(document, directory)
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise CaseError(f"cannot report {directory}: a file of the result is missing or damaged: {error}") from error
    return atomic.replace_text(directory / NAME, html)


def page(document: Document, directory: Path) -> str:
    """Return the HTML page of a result, with the cards of all formats that can carry its material.

    Raises OSError, KeyError, TypeError or ValueError if a result file is missing or damaged.
    """
    files, status = resources.files("feti_homog.report"), document["status"]
    style = files.joinpath("page.css").read_text(encoding="utf-8")
    captions = {directory / f"{name}.png": caption for name, caption in PICTURES.items()}
    captions |= {at: f"Deformed cell, {at.stem.replace('_', ' ')}" for at in sorted(directory.glob("state_*.png"))}
    pictures = [
        f'<figure><img src="data:image/png;base64,{base64.b64encode(path.read_bytes()).decode()}" alt="{caption}">'
        f"<figcaption>{caption}</figcaption></figure>"
        for path, caption in captions.items()
        if path.is_file()
    ]
    remarks = [
        f'<p class="{label.lower()}"><strong>{label}</strong> {escape(remark)}</p>'
        for label in REMARKS
        for remark in document.get(f"{label.lower()}s", ())
    ]
    cards = dict[str, str]()
    for form in export.FORMATS:
        with suppress(CaseError):  # the result has no material that the format can carry
            cards[f"Material card, {form}"] = export.card_of(document, form)
    sections = {
        "Results": "\n".join(f'<div class="scroll">{answer.html}</div>' for answer in answers(document, MOST_ROWS)),
        "Remarks": "\n".join(remarks),
        "Checks": f'<div class="scroll">{checks(document).html}</div>',
        "Pictures": "\n".join(pictures) or "<p>None: <code>feti-homog plot</code> draws them.</p>",
        "Summary": f"<pre>{escape(summary(document))}</pre>",
        "Cards": "\n".join(_folded(name, card) for name, card in cards.items()),
        "Case": _folded("Case file, with the defaults of its keys", tomli_w.dumps(document["case"])),
    }
    filled = {name: content for name, content in sections.items() if content}
    links = "\n".join(f'<a href="#{name.lower()}">{name}</a>' for name in filled)
    parts = [f'<section id="{name.lower()}">\n<h2>{name}</h2>\n{part}\n</section>' for name, part in filled.items()]
    run = f"{document['version']}, run of {document['date']}" if document.get("date") else document["version"]
    return Template(files.joinpath("page.html").read_text(encoding="utf-8")).substitute(
        policy=POLICY, title=escape(title_of(document)), style=style, run=escape(run), status=escape(status),
        verdict="good" if status == "done" else "bad", links=links, body="\n".join(parts),
    )  # fmt: skip


def _folded(title: str, text: str) -> str:
    return f"<details><summary>{title}</summary>\n<pre>{escape(text)}</pre></details>"
