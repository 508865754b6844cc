"""Tables of fibres with one fault each, and the line that reports it."""

HEAD = "x,y,radius\n"
ROW = "1,2,0.5\n"

FAULTY_TABLES = {
    "empty": ("", "t.csv: no rows; expected a line of names such as x, y, radius, then fibres"),
    "comments alone": ("# width = 3\n\n", "t.csv: no rows; expected a line of names"),
    "names alone": (HEAD, "t.csv: no fibres; expected a row for each"),
    "no names": ("1,2,3\n", 't.csv: row 1: "1, 2, 3": expected names of columns, such as x, y, radius'),
    "misspelt column": ("x,y,radius,phas\n1,2,3,a\n", 't.csv: row 1: column "phas": unknown; did you mean phase?'),
    "missing column": ("x,radius\n1,2\n", "t.csv: row 1: column y: missing"),
    "missing radius": ("x,y,phase\n1,2,fibre\n", "t.csv: row 1: column radius: missing"),
    "one semi-axis": ("x,y,a\n1,2,3\n", "t.csv: row 1: column b: missing"),
    "two units": (
        "x [mm],y/mm,d (um),angle [deg]\n1,2,3,4\n",
        "t.csv: row 1: lengths in mm and um: expected one unit",
    ),
    "units below the names": (HEAD + "cm,cm,mm\n" + ROW, "t.csv: row 1: lengths in cm and mm: expected one unit"),
    "another unit of the size": (
        "# width = 110 mm, height = 80mm\nx (cm),y (cm),r (cm)\n" + ROW,
        "t.csv: row 2: lengths in cm and mm: expected one unit",
    ),
    "column twice": ("x,y,radius,X\n1,2,3,4\n", "t.csv: row 1: column x: the name is there twice"),
    "too short a row": (HEAD + ROW + "1,2\n", "t.csv: row 3: expected 3 columns, one for each name; it has 2"),
    "too long a row": (HEAD + "1,2,3,4\n", "t.csv: row 2: expected 3 columns, one for each name; it has 4"),
    "decimal commas": (HEAD + "1,5,2,5,0,5\n", "t.csv: row 2: expected 3 columns, one for each name; it has 6"),
    "no number": (HEAD + "# comment\n\n1,here,3\n", 't.csv: row 4: y = "here": expected a number'),
    "a number with words": (HEAD + "1,2,3 um\n", 't.csv: row 2: radius = "3 um": expected a number above 0'),
    "not finite": (HEAD + "nan,2,3\n", 't.csv: row 2: x = "nan": expected a number'),
    "infinite": (HEAD + "1,inf,3\n", 't.csv: row 2: y = "inf": expected a number'),
    "too large a number": (
        HEAD + "1e300,2,3\n",
        "t.csv: row 2: x = 1e+300: expected a number; numbers other than 0 have magnitudes from 1e-100 to 1e+100",
    ),
    "an open quotation": (HEAD + '"1,2,3\n', "t.csv: row 2: a quotation mark is not closed"),
    "underscores": (HEAD + "1_0,2,3\n", 't.csv: row 2: x = "1_0": expected a number'),
    "no value": (HEAD + "1,,3\n", "t.csv: row 2: y: no value; expected a number"),
    "no radius": (HEAD + "1,2,\n", "t.csv: row 2: radius: no value; expected a number"),
    "radius 0": (HEAD + ROW + "1,2,0\n", "t.csv: row 3: radius = 0.0: expected a number above 0"),
    "negative radius": (HEAD + "1,2,-3\n", "t.csv: row 2: radius = -3.0: expected a number above 0"),
    "negative coating": (
        "x,y,radius,coating\n1,2,3,-0.1\n",
        "t.csv: row 2: coating = -0.1: expected a number at least 0",
    ),
    "matrix": ("x,y,radius,phase\n1,2,3,matrix\n", 't.csv: row 2: phase = "matrix": expected a name of letters'),
    "name of a phase": ("x,y,radius,phase\n1,2,3,e glass\n", 't.csv: row 2: phase = "e glass": expected a name'),
    "width": ("# width = -3\n" + HEAD + ROW, "t.csv: row 1: width = -3: expected a number above 0"),
    "too large a width": ("# width = 1e300\n" + HEAD + ROW, "t.csv: row 1: width = 1e300: expected a number above 0"),
    "no width": ("# width = wide\n" + HEAD + ROW, "t.csv: row 1: width = wide: expected a number above 0"),
    "two widths": ("# width = 3\n# width = 4\n" + HEAD + ROW, "t.csv: row 2: width = 4: an earlier line has 3"),
    "null characters": (
        "x,y,radius\n1,2,3\n".encode("utf-16-le"),
        "t.csv: expected text; it has null characters, like",
    ),
    "no text": (b"x,y,radius\n1,2,\xff\n", "t.csv: expected text in UTF-8; line 2 has other bytes"),
}
