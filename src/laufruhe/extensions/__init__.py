"""Capabilities outside the core, a folder each; the core imports none and finds all folders of this package."""
