"""The methods of the study: those of libraries, and the project's own, behind one signature."""
