"""How the study's figures look: scans rendered with soft light, laid out on one kind of sheet."""
