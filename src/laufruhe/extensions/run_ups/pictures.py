"""Picture of run-up and shut-down."""

from laufruhe.present.pictures import ResultPicture

PICTURE = ResultPicture(
    "run_up",
    "Largest force and travel on any mount, and roll, while the engine runs up and is shut down.",
    "laufruhe.extensions.run_ups.picture",
)
