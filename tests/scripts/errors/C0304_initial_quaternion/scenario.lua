-- exit: 2
local sat = vehicle "../satellite.yaml"
initial { bus = { attitude = { 1, 1, 0, 0 } } }
