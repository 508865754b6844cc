"""`python -m feti_homog`."""

import sys

from feti_homog.cli import main

sys.exit(main())
