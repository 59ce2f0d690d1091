"""Mathematics without engines: exact turns, spectra, sampling."""
