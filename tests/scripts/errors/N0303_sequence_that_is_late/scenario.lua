-- exit: 3
local sat = vehicle "../pendulum.yaml"
mission { duration = "10 s" }
local function later() at "1 s" end
sequence {
  name = "deploy",
  run = function()
    wait "2.5 s"
    later()
  end,
}
