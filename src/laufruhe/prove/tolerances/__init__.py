"""The worst errors of a design."""
