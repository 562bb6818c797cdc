"""Which flight tells two effects apart that the data could not, and the file that flies it."""
