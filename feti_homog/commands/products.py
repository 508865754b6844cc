"""`feti-homog plot`, `report`, `fields`, `export`, `fibres`: make pictures, pages, VTK files, cards, fibre tables."""

import argparse

from feti_homog.analysis import stored_result
from feti_homog.results import output_folder
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.runtime import standard_streams
from feti_homog.typing import Intracomm


def plot(arguments: argparse.Namespace, comm: Intracomm) -> None:
    """Draw the pictures of a stored result or unfinished path again; print their paths.  Collective."""
    from feti_homog.report.plots import figures, plot_helpers

    directory = output_folder.result_folder(arguments.directory)
    place = mpi_errors.on_root_only(comm, stored_result.check_to_draw, directory)
    look = plot_helpers.Look(arguments.format, arguments.size, arguments.title)
    paths = mpi_errors.on_root_only(comm, figures.plot, directory, look, arguments.state, arguments.component)
    if paths == [] and not place:
        standard_streams.say(f"{directory}: nothing to draw: its case has no fields, and no points that make a curve")
    for path in paths or []:
        standard_streams.say(str(path))
    if place:
        standard_streams.say(f"{directory}: {place}; pictures of its fields follow at its end")


def report(arguments: argparse.Namespace, comm: Intracomm) -> None:
    """Write report.html, the page of a stored result; print its path.  Collective."""
    from feti_homog.report import page

    directory = output_folder.result_folder(arguments.directory)
    mpi_errors.on_root_only(comm, stored_result.read, directory)
    mpi_errors.on_root_only(comm, lambda: standard_streams.say(str(page.write(directory))))


def fields(arguments: argparse.Namespace, comm: Intracomm) -> None:
    """Write the states in result.h5 to VTK files; print their paths.  Collective."""
    from feti_homog.results import viewed_states

    directory = output_folder.result_folder(arguments.directory)
    mpi_errors.on_root_only(comm, output_folder.refuse_begun, directory)
    mpi_errors.on_root_only(comm, stored_result.check_to_draw, directory)
    for path in mpi_errors.on_root_only(comm, viewed_states.write_vtk, directory, arguments.format) or []:
        standard_streams.say(str(path))


def export(arguments: argparse.Namespace, comm: Intracomm) -> None:
    """Print the material card of a result, or write it to a file.  Collective."""
    from feti_homog.report.cards import export

    directory = output_folder.result_folder(arguments.directory)
    text = mpi_errors.on_root(comm, export.card, directory, arguments.format, arguments.symmetry)
    if arguments.out is not None:
        text = str(mpi_errors.on_root(comm, output_folder.write_product, arguments.out, text))
    mpi_errors.on_root_only(comm, standard_streams.print_product, text)


def fibres(arguments: argparse.Namespace, comm: Intracomm) -> None:
    """Print the fibre table of a case, result or image; with `--out` write it, and draw the image.  Collective."""
    from feti_homog.commands import listed_fibres, micrograph

    if arguments.image is None:
        text = mpi_errors.on_root(comm, listed_fibres.table, arguments.source)
    else:
        circles, text = mpi_errors.on_root(comm, micrograph.fibres, arguments.image, arguments.pixel)
    if arguments.out is None:
        mpi_errors.on_root_only(comm, standard_streams.print_product, text)
        return
    path = mpi_errors.on_root_only(comm, output_folder.write_product, arguments.out, text)
    if path is not None:
        standard_streams.say(str(path))
    if arguments.image is not None:
        picture = arguments.image, circles, arguments.pixel, arguments.out
        mpi_errors.on_root_only(comm, lambda: standard_streams.say(micrograph.draw(*picture)))
