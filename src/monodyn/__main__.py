"""``python -m monodyn``: the same as the command ``monodyn``."""

from monodyn.cli import main

raise SystemExit(main())
