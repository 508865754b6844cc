"""Check that all of ParaView's readers show a result, in ParaView's Python: pvpython scripts/paraview_check.py DIR

Opens DIR/result.xdmf and DIR/interface.xdmf with each of ParaView's three readers of XDMF, goes through all states, and
reports an array that is missing or differs from the first reader, a state with another label, and a mesh without
elements. --pictures FOLDER draws the last state with each reader, warped by its displacement and coloured by every
array, under its label and load factor. --ranges FILE writes, as JSON for each file, reader and state, the label, the
number of elements and the ranges of the arrays.  The exit code is 1 if there are faults.

Debian has it as the package `paraview`; without a display: xvfb-run -a pvpython scripts/paraview_check.py DIR
"""

import argparse
import json
import sys
from pathlib import Path
from xml.etree import ElementTree

from paraview import servermanager, simple

READERS = {"XDMFReader": "FileNames", "Xdmf3ReaderS": "FileName", "Xdmf3ReaderT": "FileName"}
FILES = ("result.xdmf", "interface.xdmf")
SIZE = [800, 700]
# For the filter Python Annotation, of the field data: label and load factor.
TITLE = 'label.astype("u1").tobytes().decode().rstrip() + ", load factor %g" % load_factor.ravel()[0]'


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("directory", type=Path, help="folder of a result")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="draw every array into this folder")
    parser.add_argument("--ranges", type=Path, metavar="FILE", help="write what was seen as JSON")
    arguments = parser.parse_args()
    paths = [path for path in (arguments.directory.resolve() / name for name in FILES) if path.exists()]
    faults = [] if paths else [f"{arguments.directory}: no {' or '.join(FILES)}"]
    seen = {path.name: seen_in(path, faults, arguments.pictures) for path in paths}
    if arguments.ranges:
        arguments.ranges.write_text(json.dumps(seen))
    sys.exit("\n".join(faults) or 0)


def seen_in(path, faults, pictures):
    """Return the states of a file by reader; append faults to `faults`; draw if `pictures` names a folder."""
    seen = {}
    for kind in READERS:
        reader = opened(kind, path)
        seen[kind] = [state_of(reader, time) for time in reader.TimestepValues]
        faults += [f"{path.name}, {kind}: {fault}" for fault in faults_of(seen[kind], path)]
        print(f"{path.name} {kind}: {len(seen[kind])} states, {len(seen[kind][-1]['arrays'])} arrays")
        if pictures:
            draw(reader, pictures / f"{path.stem}_{kind}")
        simple.Delete(reader)
    first = next(iter(seen.values()))
    faults += [f"{path.name}, {kind}: other values than with the first reader" for kind in seen if seen[kind] != first]
    return seen


def opened(kind, path):
    """Return a reader of the file."""
    return getattr(simple, kind)(**{READERS[kind]: str(path)})


def state_of(reader, time):
    """Return the label, the number of elements and the component ranges of all arrays of a state."""
    simple.UpdatePipeline(time=time, proxy=reader)
    data = leaf_of(servermanager.Fetch(reader))
    arrays = {}
    for place, attributes in (
        ("node", data.GetPointData()),
        ("element", data.GetCellData()),
        ("state", data.GetFieldData()),
    ):
        for array in map(attributes.GetArray, range(attributes.GetNumberOfArrays())):
            if array.GetName() != "label":
                ranges = [array.GetRange(component) for component in range(array.GetNumberOfComponents())]
                arrays[f"{place} {array.GetName()}"] = ranges
    return {"time": time, "label": label_of(data), "elements": data.GetNumberOfCells(), "arrays": arrays}


def leaf_of(data):
    """Return the mesh in a data set of one block, or of one piece of one block."""
    while data.IsA("vtkCompositeDataSet"):
        data = data.GetPiece(0) if data.IsA("vtkMultiPieceDataSet") else data.GetBlock(0)
    return data


def label_of(data):
    """Return the text whose bytes are the array `label`; empty if there is none."""
    array = data.GetFieldData().GetArray("label")
    count = array.GetNumberOfValues() if array else 0
    return bytes(int(array.GetVariantValue(place).ToInt()) for place in range(count)).decode().rstrip()


def faults_of(states, path):
    """List the arrays of the file that a reader does not show."""
    grids = [grid for grid in ElementTree.parse(path).iter("Grid") if grid.get("GridType") == "Uniform"]
    places = {"Node": "node", "Cell": "element", "Grid": "state"}
    if len(states) != len(grids):
        yield f"{len(states)} states, expected {len(grids)}"
    for state, grid in zip(states, grids, strict=False):
        where = f"state {state['time']:g}"
        if state["label"] != grid.get("Name"):
            yield f"{where}: its label is {state['label']}, expected {grid.get('Name')}"
        if not state["elements"]:
            yield f"{where}: no elements"
        named = {f"{places[item.get('Center')]} {item.get('Name')}" for item in grid.iter("Attribute")}
        yield from (f"{where}: no array {name}" for name in sorted(named - set(state["arrays"]) - {"state label"}))


def draw(reader, folder):
    """Draw a picture of the last state for each array, on the warped mesh."""
    folder.mkdir(parents=True, exist_ok=True)
    view = simple.CreateView("RenderView")
    view.ViewSize, view.InteractionMode = SIZE, "2D"
    scene = simple.GetAnimationScene()
    scene.UpdateAnimationUsingDataTimeSteps()
    scene.GoToLast()
    warped = simple.WarpByVector(Input=reader)
    warped.Vectors = ["POINTS", "displacement"]
    simple.UpdatePipeline(time=reader.TimestepValues[-1], proxy=warped)
    shown = simple.Show(warped, view)
    shown.PointSize = 8.0
    title = simple.PythonAnnotation(Input=reader)
    title.ArrayAssociation, title.Expression = "Field Data", TITLE
    simple.Show(title, view)
    for association, attributes in (("POINTS", warped.PointData), ("CELLS", warped.CellData)):
        for name in sorted(array.Name for array in attributes):
            simple.ColorBy(shown, (association, name))
            shown.RescaleTransferFunctionToDataRange(False, True)
            shown.SetScalarBarVisibility(view, True)
            view.ResetCamera()
            simple.Render(view)
            simple.SaveScreenshot(str(folder / f"{name}.png"), view)
            shown.SetScalarBarVisibility(view, False)
    for proxy in (shown, warped, title, view):
        simple.Delete(proxy)


if __name__ == "__main__":
    main()
