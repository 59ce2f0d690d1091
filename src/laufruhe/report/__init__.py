"""Results as files and tables: `result.json`, `report.md`, and what the screen shows."""
