"""Reports: self-contained HTML pages of runs, campaigns and learning, each in a module of its own."""
