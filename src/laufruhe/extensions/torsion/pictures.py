"""Pictures of the crankshaft's twist."""

from laufruhe.present.pictures import ResultPicture

MODES = ResultPicture(
    "twist_modes",
    "Torsional natural modes of the crankshaft, and the speeds at which orders meet them.",
    "laufruhe.extensions.torsion.modes_picture",
)
RESPONSE = ResultPicture(
    "twist_response",
    "Torque in the crankshaft over crank speed, and speed ranges barred by a limit.",
    "laufruhe.extensions.torsion.response_picture",
)
