-- exit: 2
local p = parameters { angle = 1, time = 2 }
print(p.angl)
