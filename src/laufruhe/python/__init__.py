"""Python as engineers write it: engines and problems in code, results in notebooks."""
