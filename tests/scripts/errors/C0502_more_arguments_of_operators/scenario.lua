-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
print(sat:operators():momentum({ 1 }, "com", "world"))
