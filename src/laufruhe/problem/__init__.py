"""Design problems: decisions, measures, limits and their evaluation."""
