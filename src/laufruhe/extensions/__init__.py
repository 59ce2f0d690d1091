"""Capabilities beside the core, a folder each; the core imports none and finds them by being here."""
