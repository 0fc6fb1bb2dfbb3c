"""`python -m frazil.cli`: the same as the `frazil` command."""

import sys

from . import main

sys.exit(main())
