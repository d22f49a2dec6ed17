"""What is asked: a TOML file becomes frozen values in SI units, or one line that says what is wrong."""
