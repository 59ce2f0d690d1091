"""Pictures of built engines and of chosen parts."""

from laufruhe.present.pictures import ResultPicture

TOLERANCES = ResultPicture(
    "robust",
    "The best drawing and the design decided, each built many times, and what each tolerance costs.",
    "laufruhe.extensions.robust.picture",
)
ASSEMBLY = ResultPicture(
    "assembly",
    "The best assembly of measured parts beside those at random.",
    "laufruhe.extensions.robust.assembly_picture",
)
