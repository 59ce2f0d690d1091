"""Studies of many random draws: designs of one problem, or problems that are decided one by one."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.random_studies"
EXTENSION = Extension("random_studies", study_kinds=(f"{_HERE}.designs:RandomDesigns", f"{_HERE}.scenes:RandomScenes"))
