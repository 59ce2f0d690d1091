"""Problem and study files: TOML, CSV, their schema, and what is wrong with them."""
