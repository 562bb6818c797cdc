"""The morning's question: is it the same drone as yesterday? A hover, held against file and days."""
