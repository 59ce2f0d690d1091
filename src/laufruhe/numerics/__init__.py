"""What knows no engine: exact turns, spectra, norms, maths namespaces, processors."""
