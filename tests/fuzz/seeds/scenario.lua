local p = parameters { angle = "20 deg", gains = { 1, 2, 3 }, title = "x", on = true }
local sat = vehicle "wing.yaml"
mission { title = p.title, duration = "10 s", integrator = { method = "dopri5", relative = 1e-8 }, output = { rate = "10 Hz", reactions = { "boom" }, nodes = { "boom.tip" } } }
initial { bus = { attitude = { 1, 0, 0, 0 }, rate = { 0, 0, 0.01 } }, boom = { angle = p.angle, eta = { 0, 0, 0 } } }
local out = signals { err = { unit = "rad", components = { "x", "y" }, frame = "bus", meaning = "an error" } }
local bus, boom, tip = sat:body "bus", sat:hinge "boom", sat:node "boom.tip"
local load = tip:load { axes = "world" }
sat:hinge("arm"):profile { rate_table = { { 0, 0 }, { 1, 0.1 }, { 2, 0 } } }
controller {
  name = "hold", rate = "10 Hz",
  step = function(t)
    local w = vec.norm { bus:rate() }
    boom:torque(-p.gains[1] * boom:angle() - p.gains[2] * boom:rate())
    load:set(0, 0, 0, 0.1 * math.sin(t), 0, w)
    out.err(boom:angle(), w)
  end,
}
phase { name = "first", duration = "5 s", enter = function() print(("at %g"):format(mission.time())) end, until_ = function(t) return t > 3 end }
event { name = "crossing", when = function(t) return boom:angle() - 0.1 end, direction = "falling", action = function(t) stop() end }
check { name = "settled", unit = "rad", value = function() return math.abs(boom:angle()) end, below = 1 }
figure { name = "mass", unit = "kg", value = function() return sat:mass() end }
local m = matrix { { 2, 1 }, { 1, 3 } }
local x = m:solve(vector { 1, 2 })
for k, v in pairs { a = 1, b = 2 } do p.gains[#p.gains + 1] = v + x[1] end
