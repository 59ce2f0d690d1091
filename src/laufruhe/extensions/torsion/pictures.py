"""Pictures of the crankshaft's twist."""

from laufruhe.present.pictures import ResultPicture

MODES = ResultPicture(
    "twist_modes",
    "How the crankshaft swings in its natural modes, and the speeds at which orders meet them.",
    "laufruhe.extensions.torsion.modes_picture",
)
RESPONSE = ResultPicture(
    "twist_response",
    "Torque in the crankshaft over crank speed, with the speeds at which a limit bars it.",
    "laufruhe.extensions.torsion.response_picture",
)
