-- exit: 3
local sat = vehicle "../boom.yaml"
mission { duration = "1 s" }
