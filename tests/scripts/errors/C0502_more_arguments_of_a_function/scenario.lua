-- exit: 2
-- the fourth is the origin; seconds after the date are the third
print(table.concat(astro.position("sun", "2026-11-26T12:00:00 UTC", 0, "earth", 60), " "))
